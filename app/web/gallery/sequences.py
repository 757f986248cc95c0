"""Sequences of steps in each of their states."""

from collections.abc import Sequence
from typing import Final

from app.i18n import TextLike, say
from app.web.gallery import texts
from app.web.gallery.examples import NOT_LIVE, Example, Table

STEPS: Final[Table] = {
    "label": texts.LOADING.table,
    "current": {"topic": "/loading", "type": "std_msgs/msg/UInt8"},
    "steps": [{"text": step.table} for step in (texts.OPEN_CLAMP, texts.LAY_IN, texts.CLOSE_CLAMP)],
    "rows_shown": 3,
}
USUAL: Final = (texts.OPEN_CLAMP.shown, texts.LAY_IN.shown, texts.CLOSE_CLAMP.shown)
RECOVERY: Final = (texts.LOOK_IN.shown, texts.CLOSE_DOOR.shown, texts.TOUCH_RESET.shown)


def _shown(steps: Sequence[TextLike], states: Sequence[str], text: TextLike, mode: str) -> Table:
    notes = (texts.THROUGH_WINDOWS.shown, "", "") if mode == "recovery" else ("", "", "")
    return {
        "state": "live",
        "note": "",
        "mode": mode,
        "title": say("sequence_recovery") if mode == "recovery" else texts.LOADING.shown,
        "text": text,
        "rows": [
            {
                "number": str(number + 1),
                "text": step,
                "note": notes[number],
                "state": states[number],
                "word": say(f"sequence_{states[number]}"),
            }
            for number, step in enumerate(steps)
        ],
        "picture": "",
        "mark": [],
        "at": "",
    }


def _step(number: int) -> TextLike:
    return say("sequence_step", number=number, total=3)


SEQUENCES: Final = (
    Example("under way", "sequence", STEPS, _shown(USUAL, ("done", "now", "next"), _step(2), "usual")),
    Example(
        "all done", "sequence", STEPS, _shown(USUAL, ["done"] * 3, say("sequence_all_done"), "usual")
    ),
    Example(
        "under a fault",
        "sequence",
        STEPS,
        _shown(RECOVERY, ("now", "now", "next"), _step(1), "recovery"),
    ),
    Example(
        "the door is closed again",
        "sequence",
        STEPS,
        _shown(RECOVERY, ("past", "done", "now"), _step(3), "recovery"),
    ),
    *(
        Example(
            state,
            "sequence",
            STEPS,
            _shown(
                USUAL,
                ("done", "now", "next") if state == "old" else ["next"] * 3,
                _step(2) if state == "old" else "",
                "usual",
            )
            | {"state": state, "note": note},
        )
        for state, note in NOT_LIVE.items()
    ),
)

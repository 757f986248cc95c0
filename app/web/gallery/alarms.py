"""Alarms in the gallery."""

from typing import Any, Final

from app.i18n import number, say, time_of_day
from app.web.gallery import texts
from app.web.gallery.examples import NOTHING, Example, Table

NO_LINE: Final[Table] = {"line": None, "standing": 0, "unacknowledged": 0}
STATES: Final = (
    ("active", False, "alarm_state_active_unacknowledged", "acknowledge"),
    ("latched", True, "alarm_state_latched", "reset"),
    ("unknown", True, "alarm_state_unknown", ""),
)
LABELS: Final = {
    "acknowledge": say("alarm_acknowledge"),
    "reset": say("alarms_reset"),
    "": "",
}


def _row(priority: int) -> dict[str, Any]:
    """The alarm of a priority, with the state of its place in `STATES`."""
    state, acknowledged, word, act = STATES[(priority - 1) % len(STATES)]
    return {
        "id": f"alarm_{priority}",
        "priority": priority,
        "priority_text": say(f"alarm_priority_{priority}"),
        "known": state != "unknown",
        "occurrence": 1,
        "since_text": time_of_day("14:31:58"),
        "text": texts.AIR_INLET.shown,
        "action": texts.LOOK_IN.shown,
        "state": state,
        "state_text": say(word),
        "acknowledged": acknowledged,
        "group": texts.GRIPPER.shown,
        "follows_text": "",
        "value_text": number("4.8", "bar"),
        "limit_text": number("5", "bar"),
        "first": priority == 1,
        "acts": ["out_of_service" if priority == 1 else "shelve"],
        "shelf": None,
        "out_of_service": None,
        "act": act,
        "act_text": LABELS[act],
    }


def _line(priority: int) -> Table:
    return {"state": "live", "alarms": {"line": _row(priority), "standing": 5, "unacknowledged": 3}}


ALARMS: Final = (
    *(
        Example(f"line, priority {priority}", "alarm_line", NOTHING, _line(priority))
        for priority in (1, 2, 3)
    ),
    Example("line, none", "alarm_line", NOTHING, {"state": "live", "alarms": NO_LINE}),
    Example(
        "list",
        "alarm_list",
        {"label": texts.AIR_INLET.table},
        {
            "state": "live",
            "alarms": {
                "rows": [_row(priority) for priority in (1, 2, 3, 4)],
                "more": say("alarms_more", count=number("12")),
            },
        },
    ),
    Example(
        "list, none",
        "alarm_list",
        {"label": texts.AIR_INLET.table},
        {"state": "live", "alarms": {"rows": [], "more": ""}},
    ),
)

"""The stable name of a receipt's reason, for programs: the code of the sentence that says why."""

from collections.abc import Mapping
from typing import Final

from app.dialect.peer_traits import EVERY_SENTENCES
from app.i18n import BETWEEN, Text, TextLike
from app.permission.confirmations import CONFIRMED_CODES

# Sentences that only frame another one → the parameter with that sentence.
FRAMES: Final[Mapping[str, str]] = {
    "refused": "why",
    "press_not_encoded": "why",
    "hold_ended": "why",
    "with_stop": "said",
    "with_reply": "said",
    "log_not_on_disk": "said",
}
# They follow a reason and are none themselves.
ADVICE: Final = frozenset(
    {*(s.timeout_hint for s in EVERY_SENTENCES if s.timeout_hint), *CONFIRMED_CODES}
)


def reason_code(reason: TextLike) -> str | None:
    """The code of the innermost sentence: "Not sent at 10:04:32: Locked: …" has that of the lock. Of
    several sentences the last one counts. None for a reason without a sentence of the catalogue."""
    if not isinstance(reason, Text) or not reason.is_sentence:
        return None
    about = dict(reason.params)
    if reason.code in BETWEEN:
        parts = about["parts"]
        assert isinstance(parts, tuple)  # as `joined` makes it
        codes = [code for part in parts if (code := reason_code(part)) and code not in ADVICE]
        return codes[-1] if codes else None
    framed = about.get(FRAMES.get(reason.code, ""))
    inner = reason_code(framed) if isinstance(framed, Text) else None
    return inner or reason.code

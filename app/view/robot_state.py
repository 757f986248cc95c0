"""The state of the robot in one word, as the frame shows it: pure, from the verdicts."""

from collections.abc import Collection
from functools import cache
from typing import Final, Literal, TypedDict

from app.i18n import TextLike, say
from app.permission.verdict import Verdict

FORBIDDEN: Final = frozenset({"forbidden", "unmet"})


State = Literal["ready", "online", "locked", "unknown", "lost"]


class RobotWord(TypedDict):
    """`state` is "ready" if all interlocks permit, "online" if the panel has none, "locked" if one
    forbids, "unknown" if one is unknown, "lost" without a connection to the robot."""

    state: State
    text: TextLike


def robot_word(passable: Verdict, interlocks: Collection[Verdict]) -> RobotWord:
    """The word for the verdicts of the link and of all interlocks. "locked" goes before "unknown"."""
    refused = [one for one in interlocks if not one.permitted]
    if not passable.permitted:
        return _word("unknown" if passable.code in ("joining", "catching_up") else "lost")
    if any(one.code in FORBIDDEN for one in refused):
        return _word("locked")
    if not interlocks:
        return _word("online")
    return _word("unknown" if refused else "ready")


@cache
def _word(state: State) -> RobotWord:
    """The same object for the same state. It must not be changed."""
    return RobotWord(state=state, text=say(f"state_{state}"))


UNKNOWN: Final = _word("unknown")

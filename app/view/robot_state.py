"""Whether the robot is there, in one word, as the frame shows it: pure, from the link's verdict.

What the machine does is the robot's to say, see `[state]` of a panel file; what is permitted is said
at each button.
"""

from functools import cache
from typing import Final, Literal, TypedDict

from app.i18n import TextLike, say
from app.permission.verdict import Verdict

State = Literal["online", "unknown", "lost"]


class RobotWord(TypedDict):
    """`state` is "online" with a connection to the robot, "lost" without one, "unknown" while it is
    being set up."""

    state: State
    text: TextLike


def robot_word(passable: Verdict) -> RobotWord:
    """The word for the verdict of the link."""
    if passable.permitted:
        return _word("online")
    return _word("unknown" if passable.code in ("link_connecting", "link_catching_up") else "lost")


@cache
def _word(state: State) -> RobotWord:
    """The same object for the same state. It must not be changed."""
    return RobotWord(state=state, text=say(f"state_{state}"))


UNKNOWN: Final = _word("unknown")

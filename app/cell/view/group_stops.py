"""A stop button that is for several robots: its attributes, from those of each robot. Pure."""

from collections.abc import Sequence
from typing import Final, NamedTuple

from app.cell.view.kinds import Attributes
from app.system.texts import TextLike, joined, say

# What is shown where the robots' own values differ; "" for all others.
DIFFERENT: Final[Attributes] = {
    "aged": False,
    "busy": False,
    "progress": None,
    "state": "waiting",
    "shape": "unknown",
    "colour": "none",
}


class StopOfRobot(NamedTuple):
    """The stop button of one robot, as that robot's view has it; `name` is the robot's."""

    name: TextLike
    attributes: Attributes


def group_stop(stops: Sequence[StopOfRobot]) -> Attributes:
    """It is locked only where each robot's is: the press stops those that it reaches."""
    permitted = any(shown["enabled"] for _, shown in stops)
    reasons = [(name, shown["reason"] or "") for name, shown in stops]
    texts: Sequence[TextLike] = [reasons[0][1]]
    if any(said != texts[0] for _, said in reasons):
        texts = [say("stop_of_robot", robot=name, said=said) for name, said in reasons]
    reason = None if permitted else joined(texts, "between_lines")
    alike = {
        name: value if all(shown[name] == value for _, shown in stops) else DIFFERENT.get(name, "")
        for name, value in stops[0].attributes.items()
    }
    own = {"enabled": permitted, "reason": reason, "reasons": reason or "", "more": ""}
    own |= {"stoppable": False, "press": ""}  # each robot's goal is its own
    return alike | {name: value for name, value in own.items() if name in alike}

"""What the details of a robot's link say of its definitions: which differ from the panel's, and which
can't be compared. Pure."""

import math
from collections.abc import Iterator
from typing import Final

from app.dialect.endpoint import Role
from app.i18n import TextLike, joined, say
from app.robot.definitions import Difference, is_unhashed, uncallable_dds
from app.robot.graph import LiveGraph, cached_until_change
from app.robot.state import RobotState

NAMED_MOST: Final = 3


def definition_notes(robot: RobotState) -> TextLike:
    """A line for each difference, and one for all that can't be compared; "" for neither."""
    return _notes(robot.graph, robot)


@cached_until_change
def _notes(graph: LiveGraph, robot: RobotState) -> TextLike:
    differing: dict[str, Difference] = {}
    unhashed: list[str] = []
    for role, name in robot.presence.required:
        key = robot.key(name)
        if (difference := robot.difference(role, key)) is not None:
            differing[name] = difference
        elif not graph.is_simulated and _can_not_be_compared(graph, role, key):
            unhashed.append(name)
    return joined([*_differences(differing, robot), *_unhashed(unhashed)], "between_lines")


def _can_not_be_compared(graph: LiveGraph, role: Role, key: str) -> bool:
    is_read = role in ("MP", "MS") or graph.nodes_read_at > -math.inf
    return is_read and is_unhashed(graph, role, key) and not uncallable_dds(graph, role, key)


def _differences(differing: dict[str, Difference], robot: RobotState) -> Iterator[TextLike]:
    for name, difference in [*differing.items()][:NAMED_MOST]:
        yield say(
            "link_definition_hashes",
            name=name,
            type=difference.type,
            node=difference.node or say("link_definition_node_unknown"),
            theirs=difference.theirs,
            ours=difference.ours,
            source=robot.definition_source(difference.type),
        )
    if len(differing) > NAMED_MOST:
        yield say("link_definitions_more", number=len(differing) - NAMED_MOST)


def _unhashed(names: list[str]) -> Iterator[TextLike]:
    if not names:
        return
    named, more = tuple(names[:NAMED_MOST]), len(names) - NAMED_MOST
    yield say("link_no_hashes", names=say("and_more", names=named, number=more) if more > 0 else named)

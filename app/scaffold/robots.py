"""Several robots behind one bridge, by their namespaces. Pure."""

from collections.abc import Mapping, Sequence
from typing import Final

from app.scaffold.draft import shown
from app.survey.model import RobotGraph

LEAST_ALIKE: Final = 2  # topics that robots of one kind have in common


def alike_namespaces(robot: RobotGraph) -> tuple[str, ...]:
    """The namespaces ("/left", "/right") of which each has at least half of its topics in common with
    one of them: the same names below them, with the same types. () if there are not two."""
    contents: dict[str, set[tuple[str, str]]] = {}
    for topic in shown(robot.topics):
        first, _, rest = topic.name[1:].partition("/")
        if rest and not topic.name.startswith("//"):
            contents.setdefault(f"/{first}", set()).add((rest, topic.type))
    groups = (_alike(namespace, contents) for namespace in contents)
    largest = max(groups, key=len, default=())
    return tuple(f"{robot.namespace}{namespace}" for namespace in largest)


def _alike(namespace: str, contents: Mapping[str, set[tuple[str, str]]]) -> tuple[str, ...]:
    """The namespaces that are like one of them, which is among them."""
    own = contents[namespace]

    def is_alike(its: set[tuple[str, str]]) -> bool:
        common = len(own & its)
        return common >= LEAST_ALIKE and 2 * common >= max(len(own), len(its))

    alike = tuple(name for name, its in contents.items() if is_alike(its))
    return alike if len(alike) > 1 else ()


def proposal(namespaces: Sequence[str]) -> str:
    """The sentence about namespaces that look like robots."""
    options = " ".join(f"--robot {namespace}" for namespace in namespaces)
    return (
        f"{', '.join(namespaces)} have the same topics. If each is a robot, {options} makes a [[robot]]"
        " table for each, with the pages for all of them."
    )

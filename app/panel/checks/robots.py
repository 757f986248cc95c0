"""Checks of `[[robot]]`, and of how the robots are reached."""

from collections.abc import Iterator, Sequence
from itertools import islice
from typing import Final

from app.dialect.dialect import WITH_OWN_DOMAIN
from app.errors import Fault
from app.i18n.values import alike
from app.panel.model import Panel, RobotEntry

OF_ONE_ROBOT: Final = "is of the one robot: with [[robot]] each has its own"


def robot_faults(panel: Panel) -> Iterator[Fault]:
    """Faults of robots: each needs its own id, name, and namespace or endpoints."""
    yield from duplicate_ids("robot", [robot.id for robot in panel.robots])
    if panel.robots and panel.namespace:
        yield Fault("namespace", OF_ONE_ROBOT)
    if panel.robots:
        chosen = panel.model_fields_set & {"dialect", "domain"}
        yield from (Fault(key, OF_ONE_ROBOT) for key in sorted(chosen))
    else:
        yield from _domain_faults("", panel)
    for r, robot in enumerate(panel.robots):
        yield from islice(_duplicate_robot_faults(f"robot[{r}]", robot, panel.robots[:r]), 1)
        yield from _domain_faults(f"robot[{r}].", robot)


def _domain_faults(place: str, robot: Panel | RobotEntry) -> Iterator[Fault]:
    if robot.domain and robot.dialect in WITH_OWN_DOMAIN:
        why = f"is of rmw_zenoh: with {robot.dialect} the bridge has it in its own configuration"
        yield Fault(f"{place}domain", why)


def _duplicate_robot_faults(
    place: str, robot: RobotEntry, others: Sequence[RobotEntry]
) -> Iterator[Fault]:
    """Faults of a robot with the name or the address of another one. An equal id is reported
    elsewhere."""
    for a, above in enumerate(others if robot.id not in [other.id for other in others] else ()):
        if alike(robot.name, above.name):
            yield Fault(f"{place}.name", f'"{robot.name}" is already the name of robot[{a}]')
        if _address(robot) == _address(above):
            same = f"robot[{a}] has the same namespace and endpoints: it would be the same robot"
            yield Fault(f"{place}.namespace", same)


def _address(robot: RobotEntry) -> tuple[object, ...]:
    return robot.namespace, robot.connect, robot.dialect, robot.domain


def duplicate_ids(table: str, ids: list[str]) -> Iterator[Fault]:
    for i, name in enumerate(ids):
        if name in ids[:i]:
            yield Fault(f"{table}[{i}].id", f'"{name}" is already the id of {table}[{ids.index(name)}]')

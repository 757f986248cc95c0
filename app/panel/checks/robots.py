"""Checks of `[[robot]]`, and of how the robots are reached."""

from collections.abc import Iterator, Sequence
from itertools import islice
from typing import Final

from app.panel.file.wording import no_such
from app.panel.model import Panel, RobotEntry
from app.panel.numbers import NUMBERS
from app.panel.robot_panels import widget_robots
from app.panel.template import input_ids
from app.panel.times import TIME_FORMATS
from app.panel.widgets.families import CheckContext, Command
from app.panel.widgets.inputs import SelectInput
from app.panel.widgets.map_view import MapView
from app.panel.widgets.place import MapInput
from app.ros.dialects.dialect import WITH_OWN_DOMAIN
from app.ros.messages import Interfaces
from app.ros.messages.validation import format_value
from app.system.errors import Fault
from app.system.texts.text import alike

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


def robot_name_faults(panel: Panel) -> Iterator[Fault]:
    """Faults of tables that name a robot which the panel does not have."""
    known = [str(robot.id) for robot in panel.robots]
    if len({*known}) < len(known):
        return  # one of them has another id
    for place, robot in _named_robots(panel):
        if robot is not None and not known:
            message = "this panel has one robot: it is of [[robot]] tables, which are missing"
            yield Fault(f"{place}.robot", message, cause=f"robot {robot}")
        elif robot is not None and robot not in known:
            yield Fault(f"{place}.robot", no_such("robot", robot, known), cause=f"robot {robot}")


def overview_faults(panel: Panel) -> Iterator[Fault]:
    """Faults of overviews, which have a tile for each robot and nothing else."""
    for p, page in enumerate(panel.pages):
        place = f"page[{p}]"
        if not page.overview:
            if page.total:
                yield Fault(
                    f"{place}.total",
                    "is of an overview: write overview = true in this table too",
                    cause="page",
                )
            continue
        if not panel.robots:
            yield Fault(f"{place}.overview", "is for several robots: this panel has no [[robot]] table")
        keys = {
            "widget": page.own,
            "group": page.groups,
            "template": page.template,
            "robot": page.robot,
        }
        for key, value in keys.items():
            if value:
                message = "has no meaning on an overview: it has a tile for each robot, and no more"
                yield Fault(f"{place}.{key}", message, cause="robot overview")


def choice_faults(panel: Panel) -> Iterator[Fault]:
    """Faults of commands that send what is chosen from another robot's list or on its map."""
    robots = widget_robots(panel)
    selects = {
        widget.id: robots[widget.id]
        for widget in panel.widgets()
        if widget.id in robots
        and (
            isinstance(widget, MapInput)
            or (isinstance(widget, SelectInput) and widget.options_from is not None)
        )
    }
    for p, page in enumerate(panel.pages):
        for place, widget, robot in page.robots() if selects else ():
            if not isinstance(widget, Command):
                continue
            for name in input_ids(widget):
                if name in selects and robot != selects[name]:
                    message = (
                        f'sends "{name}", which "{selects[name]}" lists: its options are of that robot,'
                        f' so write robot = "{selects[name]}" here too'
                    )
                    yield Fault(f"page[{p}].{place}", message, cause=f"robot {name}")


def map_faults(panel: Panel) -> Iterator[Fault]:
    """Faults of maps of all robots, which have to be on a page of each."""
    robots = widget_robots(panel)
    for p, page in enumerate(panel.pages):
        for place, widget in page.placed():
            if not isinstance(widget, MapView) or widget.robots == "this":
                continue
            at, robot = f"page[{p}].{place}.robots", robots.get(str(widget.id))
            if not panel.robots:
                message = "is for several robots: this panel has no [[robot]] table"
                yield Fault(at, message, cause="robot map")
            elif robot is not None:
                message = f'is "all", and this map is of "{robot}": a map of all robots is on a page of'
                message += " each, so leave out robot here and on its page"
                yield Fault(at, message, cause=f"robot {robot}")


def figure_faults(panel: Panel, checking: CheckContext) -> Iterator[Fault]:
    """Faults of the robots' figures, and of the totals of overviews."""
    faults: list[Fault] = []
    for r, robot in enumerate(panel.robots):
        if robot.figure is not None:
            faults += robot.figure.faults(f"robot[{r}].overview", checking)
    yield from faults
    for p, page in enumerate(panel.pages if not faults else ()):
        if page.overview and page.total and panel.robots:
            yield from islice(_total_faults(f"page[{p}].total", panel, checking.interfaces), 1)


def _total_faults(place: str, panel: Panel, interfaces: Interfaces) -> Iterator[Fault]:
    """Faults of a sum of the robots' figures."""
    figures = [(f"robot[{r}].overview", robot.figure) for r, robot in enumerate(panel.robots)]
    known = [(at, figure) for at, figure in figures if figure is not None]
    if not known:
        yield Fault(
            place, "adds the robots' figures, and none has one: write [robot.overview]", cause="figure"
        )
    for at, figure in known:
        kind = interfaces.field_type(figure.type, figure.field)
        if kind not in NUMBERS or figure.format in TIME_FORMATS:
            yield Fault(place, f"adds the robots' figures: that of {at} is no number", cause="figure")
        if figure.unit != known[0][1].unit:
            first, unit = known[0][0], format_value(figure.unit)
            why = f"adds the robots' figures, which needs the same unit: that of {at} is {unit},"
            why += f" and that of {first} {format_value(known[0][1].unit)}"
            yield Fault(place, why, cause="figure")


def _named_robots(panel: Panel) -> Iterator[tuple[str, str | None]]:
    """(place, robot) of each table that may name one."""
    yield from ((f"interlock[{i}]", interlock.robot) for i, interlock in enumerate(panel.interlocks))
    yield from ((f"condition[{c}]", each.robot) for c, each in enumerate(panel.own_conditions))
    yield from ((f"place[{p}]", place.robot) for p, place in enumerate(panel.places))
    yield from ((f"zone[{z}]", zone.robot) for z, zone in enumerate(panel.zones))
    yield from ((f"zone_file[{z}]", each.robot) for z, each in enumerate(panel.zone_files))
    yield from ((f"alarm[{a}]", alarm.robot) for a, alarm in enumerate(panel.alarms))
    yield from ((f"frame.widget[{w}]", each.robot) for w, each in enumerate(panel.frame.widgets))
    for p, page in enumerate(panel.pages):
        yield f"page[{p}]", page.robot
        yield from ((f"page[{p}].group[{g}]", group.robot) for g, group in enumerate(page.groups))
        yield from ((f"page[{p}].{place}", widget.robot) for place, widget in page.placed())


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

"""Checks of `inhibits`: the controls that an alarm locks, and the robots that they are of."""

from collections.abc import Collection, Iterator

from app.errors import Fault
from app.panel.alarm import Alarm
from app.panel.faults.wording import closest_name, list_names
from app.panel.inhibits import EVERY_ROBOT, InhibitedName, inhibited_name
from app.panel.model import Panel
from app.panel.robot_panels import widget_robots


def inhibit_faults(
    place: str, alarm: Alarm, panel: Panel, controls: Collection[str]
) -> Iterator[Fault]:
    """Faults of names of no control, of a stop button, and of robots that do not have the control.
    `controls` are the ids of all."""
    stops = {widget.id for widget in panel.stops}
    for i, written in enumerate(alarm.inhibits):
        at, name = f"{place}.inhibits[{i}]", inhibited_name(written)
        if name.control not in controls:
            near = closest_name(name.control, controls)
            hint = f'did you mean "{near}"?' if near else f"there is {list_names(controls)}"
            cause = f"control {name.control}"
            yield Fault(at, f'no control "{name.control}"; {hint}', cause=cause)
        elif name.control in stops:
            yield Fault(at, f'"{name.control}" stops the machine: an alarm may not lock it')
        elif name.robot:
            yield from _robot_faults(at, name, panel)


def _robot_faults(at: str, name: InhibitedName, panel: Panel) -> Iterator[Fault]:
    robots = [str(robot.id) for robot in panel.robots]
    control, own = name.control, widget_robots(panel).get(name.control)
    if not robots:
        message = f'this panel has one robot, without an id: write "{control}"'
        yield Fault(at, message, cause=f"robot {name.robot}")
    elif len({*robots}) < len(robots):
        return  # one of them has another id
    elif name.robot != EVERY_ROBOT and name.robot not in robots:
        near = closest_name(name.robot, robots)
        hint = f'did you mean "{near}/{control}"?' if near else f"there is {list_names(robots)}"
        yield Fault(at, f'no robot "{name.robot}"; {hint}', cause=f"robot {name.robot}")
    elif own in robots and name.robot != own:
        message = f'"{control}" is a control of "{own}" alone: write "{control}" or "{own}/{control}"'
        yield Fault(at, message)

"""Simulated robots in the server's own process. What simulates is imported where it is needed: a server
with a real robot starts without it."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from app.panel.model import Panel, RobotEntry

if TYPE_CHECKING:
    from app.tools.simulator.robot import SimulatedRobot


@contextmanager
def in_process(panel: Panel, entry: RobotEntry | None = None) -> Iterator[str]:
    """The robot that a panel is for, or one of several; yields the endpoint to connect to.

    That is a port, as a process that is killed leaves none: of a socket's file the folder would stay.
    """
    from app.ros.messages import load_interfaces
    from app.tools.simulator.panel_robot import PanelRobot
    from app.tools.simulator.zenoh import ANY_PORT, Simulator, way_of

    number = panel.robots.index(entry) if entry else 0
    namespace = entry.namespace if entry else panel.namespace
    interfaces = load_interfaces(panel.distro, panel.interfaces)
    reached = entry or panel
    ways = {namespace: way_of(panel, reached)}
    with Simulator(ANY_PORT, {namespace: PanelRobot(panel, number)}, interfaces, ways=ways) as robot:
        yield robot.endpoint


def robots_of(panel: Panel) -> "dict[str, SimulatedRobot]":
    """Namespace → robot of each robot of a panel. Of several with the same namespace there is one."""
    from app.tools.simulator.panel_robot import PanelRobot

    namespaces = dict.fromkeys(robot.namespace for robot in panel.robots) or {panel.namespace: None}
    return {name: PanelRobot(panel, number) for number, name in enumerate(namespaces)}

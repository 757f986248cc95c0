"""Types that are not there or can't be used: those of widgets, and those of the kiosk itself."""

from collections.abc import Iterator
from typing import Final

from app.errors import Fault, InterfaceError
from app.interfaces import Interfaces
from app.panel.model import Panel
from app.panel.widgets.parameter import DESCRIBE, EVENT_TYPE, GET, SET

# What the kiosk says and hears beside what widgets are for.
ROSOUT: Final = "rcl_interfaces/msg/Log"
OF_PARAMETERS: Final = (EVENT_TYPE, *(f"{name}_Request" for _, name in (GET, DESCRIBE, SET)))
OF_ACTIONS: Final = ("action_msgs/msg/GoalStatusArray", "action_msgs/srv/CancelGoal_Request")


def type_fault(place: str, error: InterfaceError) -> Fault:
    """A type that can't be used; one file, package or name that is wrong may be that of several."""
    return Fault(place, str(error), cause=f"type {error.source or error.package or error}")


def own_type_faults(panel: Panel, interfaces: Interfaces) -> Iterator[Fault]:
    """The first type that the kiosk needs for this panel and can't use: a folder of interfaces may have
    these types too, and files of them that are wrong."""
    parameters = OF_PARAMETERS if any(panel.parameters()) else ()
    actions = OF_ACTIONS if panel.actions() else ()
    for name in (ROSOUT, *parameters, *actions):
        try:
            interfaces.require(name)
        except InterfaceError as error:
            source = error.source
            folders = enumerate(panel.interfaces)
            at = next((i for i, one in folders if source and source.is_relative_to(one)), 0)
            yield Fault(f"interfaces[{at}]", f"the panel needs this type: {error}")
            return

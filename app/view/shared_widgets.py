"""Widgets of other robots on the pages of one robot: each is shown from the view of its own robot."""

from collections.abc import Mapping
from typing import Final, NamedTuple

from app.permission.control_authority_view import ControlView
from app.view.kinds import Attributes


class SharedWidgets(NamedTuple):
    """The attributes of widgets of other robots, by the widgets' ids. `without_control` has those for
    clients without control of a robot, by the robot's id, and `controls` who has control of each."""

    widgets: Mapping[str, Attributes]
    without_control: Mapping[str, Mapping[str, Attributes]]
    controls: Mapping[str, ControlView]


NO_SHARED: Final = SharedWidgets({}, {}, {})

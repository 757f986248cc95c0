"""The table of widget kinds."""

from collections.abc import Mapping
from functools import reduce
from operator import or_
from typing import TYPE_CHECKING, Annotated, Any, Final, TypeVar

from pydantic import Field

from app.panel.widgets.camera import Camera
from app.panel.widgets.displays import Indicator, Readout
from app.panel.widgets.families import BaseWidget
from app.panel.widgets.gauge import Gauge
from app.panel.widgets.hold import Hold
from app.panel.widgets.inputs import SelectInput, TextInput, ToggleInput
from app.panel.widgets.joints import Joints
from app.panel.widgets.joystick import Joystick
from app.panel.widgets.log_view import LogView
from app.panel.widgets.numbers import NumberInput, SliderInput
from app.panel.widgets.parameter import Parameter
from app.panel.widgets.publish import Publish
from app.panel.widgets.service_action import Action, Call
from app.panel.widgets.static import PageLink, Picture, TextLabel
from app.panel.widgets.step import Step
from app.panel.widgets.table import Table
from app.panel.widgets.trend import Trend

KINDS: Final[Mapping[str, type[BaseWidget]]] = {
    "text": TextInput,
    "number": NumberInput,
    "slider": SliderInput,
    "select": SelectInput,
    "toggle": ToggleInput,
    "publish": Publish,
    "hold": Hold,
    "step": Step,
    "joystick": Joystick,
    "call": Call,
    "action": Action,
    "parameter": Parameter,
    "readout": Readout,
    "indicator": Indicator,
    "gauge": Gauge,
    "joints": Joints,
    "table": Table,
    "camera": Camera,
    "log": LogView,
    "trend": Trend,
    "label": TextLabel,
    "image": Picture,
    "link": PageLink,
}

# The description of a widget's table, by its "kind".
if TYPE_CHECKING:
    Widget = BaseWidget
else:
    Widget = Annotated[reduce(or_, KINDS.values()), Field(discriminator="kind")]

Row = TypeVar("Row")


def find_row(rows: Mapping[type[Any], Row], widget: BaseWidget) -> Row:
    """The row of a widget's kind in a table by kinds and families, else that of its nearest family.
    TypeError without one."""
    for of in type(widget).__mro__:
        if of in rows:
            return rows[of]
    raise TypeError(f'there is no row for a widget of the kind "{widget.kind}"')

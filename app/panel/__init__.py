"""The panel file: parses TOML into frozen, checked descriptions."""

from app.panel.condition import Interlock
from app.panel.file.load import CheckedPanel, check_panel, load_panel
from app.panel.layout import Page
from app.panel.model import Panel
from app.panel.widgets.displays import Indicator, LampState, Readout
from app.panel.widgets.families import Display, Input
from app.panel.widgets.hold import Hold
from app.panel.widgets.inputs import SelectInput, TextInput, ToggleInput
from app.panel.widgets.numbers import NumberInput, SliderInput
from app.panel.widgets.publish import Publish

__all__ = [
    "CheckedPanel",
    "Display",
    "Hold",
    "Indicator",
    "Input",
    "Interlock",
    "LampState",
    "NumberInput",
    "Page",
    "Panel",
    "Publish",
    "Readout",
    "SelectInput",
    "SliderInput",
    "TextInput",
    "ToggleInput",
    "check_panel",
    "load_panel",
]

"""The sizes of a page's parts, as static/css has them: lengths are CSS pixels."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final, Self

from app.panel.widgets.camera import Camera
from app.panel.widgets.families import BaseWidget, Display, Input, KeyCommand
from app.panel.widgets.gauge import Gauge
from app.panel.widgets.joints import Joints
from app.panel.widgets.joystick import Joystick
from app.panel.widgets.kinds import find_row
from app.panel.widgets.log_view import LogView
from app.panel.widgets.numbers import NumberInput, SliderInput
from app.panel.widgets.parameter import Parameter
from app.panel.widgets.service_action import Action
from app.panel.widgets.static import PageLink, TextLabel
from app.panel.widgets.step import Step
from app.panel.widgets.table import Table
from app.panel.widgets.trend import Trend

WIDE, MIDDLE, NARROW = 1200, 900, 600  # from these widths on a page has all columns, two, one
KEY_MM, ENTRY_MM, GAP_MM = 20.0, 14.0, 5.0
UPRIGHT: Final = 1000  # from this height on a narrow screen has two rows of groups
LOW_SCREEN: Final = 560  # up to this height a row with a cancel key is as low as an entry
TOUCH: Final = 44.0  # the least of what is touched
ROW_GAP: Final = 12.0
LABEL: Final = 25.0  # above an entry
DISPLAY, LOW_DISPLAY = 72.0, 66.0
PARAMETER: Final = 80.0  # name, value and note
PARAMETER_WIDTH: Final = 314.0  # its entry and its key side by side
SLIDER_WIDTH: Final = 200.0
NUMBER_WIDTH: Final = 100.0
DISPLAY_WIDTH: Final = 80.0
UPRIGHT_GAUGE, LOW_UPRIGHT_GAUGE, LYING_GAUGE = 124.0, 108.0, 92.0
GAUGE_WIDTH: Final = 130.0
JOINTS_FRAME: Final = 41.0  # name and note
JOINT, LOW_JOINT = 34.0, 25.0
JOINTS_WIDTH: Final = 220.0
TABLE_FRAME: Final = 69.0  # name, heads of the columns and note
ROW, LOW_ROW = 36.0, 30.0
TABLE_WIDTH: Final = 280.0
STEP_VALUE: Final = 116.0  # the value between the keys
PAD_MM: Final = 60.0
LOG: Final = (100.0, 300.0)  # some lines, and the width of what is wanted of them
PICTURE: Final = (120.0, 160.0)  # the least height and width in which a picture is readable
TREND: Final = 150.0  # names and values of the pens, plot and time axis
TREND_WIDTH: Final = 240.0
TREND_KEYS: Final = 5


@dataclass(frozen=True, slots=True)
class Screen:
    """A screen's size, and its CSS pixels to a millimetre."""

    width: int
    height: int
    mm: float

    @classmethod
    def of(cls, size: str, mm_per_px: float) -> Self:
        """From a size like "1280x800"."""
        width, height = map(int, size.split("x"))
        return cls(width, height, 1 / mm_per_px)

    @property
    def is_wide(self) -> bool:
        """Whether all groups stand side by side, with the tabs at the side."""
        return self.width >= WIDE and self.width >= self.height

    @property
    def is_upright(self) -> bool:
        """Whether the first group stays above the others, which take turns."""
        return self.width < MIDDLE and self.height >= UPRIGHT

    @property
    def pad(self) -> float:
        """Around and inside groups."""
        return 8.0 if self.width < MIDDLE else 12.0

    def touch(self, millimetres: float) -> float:
        """The height of what is touched."""
        return max(TOUCH, millimetres * self.mm)


def height_of(widget: BaseWidget, screen: Screen) -> float:
    """The height of one widget, with what stands above and below it."""
    own = OWN_HEIGHTS.get(type(widget))
    return find_row(SIZES, widget)[0](screen) if own is None else own(widget, screen)


def width_needed(widget: BaseWidget, screen: Screen) -> float:
    """The least width in which a widget can be used."""
    if isinstance(widget, Trend) and widget.keys:
        return (TREND_KEYS * KEY_MM + (TREND_KEYS - 1) * GAP_MM) * screen.mm
    return find_row(SIZES, widget)[1](screen)


def _key(screen: Screen, height_mm: float = KEY_MM) -> float:
    """Keys have their distance above and below too."""
    return screen.touch(height_mm) + GAP_MM * screen.mm - ROW_GAP


def _action(screen: Screen) -> float:
    return _key(screen, ENTRY_MM if screen.height <= LOW_SCREEN else KEY_MM)


def _display(screen: Screen) -> float:
    return LOW_DISPLAY if screen.height <= LOW_SCREEN else DISPLAY


def _trend_keys(screen: Screen) -> float:
    return screen.touch(KEY_MM) + 8


def _entry(screen: Screen) -> float:
    return LABEL + screen.touch(ENTRY_MM)


Size = Callable[[Screen], float]
# (height, least width) of each kind or family.
SIZES: Final[Mapping[type[Any], tuple[Size, Size]]] = {
    BaseWidget: (_display, lambda of: DISPLAY_WIDTH),
    Display: (_display, lambda of: DISPLAY_WIDTH),
    KeyCommand: (_key, lambda of: KEY_MM * of.mm),
    PageLink: (_key, lambda of: KEY_MM * of.mm),
    TextLabel: (lambda of: LABEL, lambda of: DISPLAY_WIDTH),
    Action: (_action, lambda of: (2 * KEY_MM + GAP_MM) * of.mm),
    Input: (_entry, lambda of: KEY_MM * of.mm),
    NumberInput: (_entry, lambda of: NUMBER_WIDTH),
    SliderInput: (_entry, lambda of: SLIDER_WIDTH),
    LogView: (lambda of: of.touch(10) + LABEL + LOG[0], lambda of: LOG[1]),
    Joystick: (lambda of: of.touch(PAD_MM), lambda of: PAD_MM * of.mm),
    Camera: (lambda of: PICTURE[0], lambda of: PICTURE[1]),
    Trend: (lambda of: TREND, lambda of: TREND_WIDTH),
    Parameter: (lambda of: PARAMETER + of.touch(ENTRY_MM), lambda of: PARAMETER_WIDTH),
    Gauge: (lambda of: UPRIGHT_GAUGE, lambda of: GAUGE_WIDTH),
    Joints: (lambda of: JOINTS_FRAME, lambda of: JOINTS_WIDTH),
    Step: (_key, lambda of: 2 * KEY_MM * of.mm + STEP_VALUE),
    Table: (lambda of: TABLE_FRAME, lambda of: TABLE_WIDTH),
}


def _gauge(gauge: Gauge, screen: Screen) -> float:
    if gauge.orientation == "horizontal":
        return LYING_GAUGE
    return LOW_UPRIGHT_GAUGE if screen.height <= LOW_SCREEN else UPRIGHT_GAUGE


def _joints(widget: Joints, screen: Screen) -> float:
    return JOINTS_FRAME + len(widget.joints) * (LOW_JOINT if screen.height <= LOW_SCREEN else JOINT)


# Heights of the kinds in which they depend on the widget's keys.
OWN_HEIGHTS: Final[Mapping[type[Any], Callable[[Any, Screen], float]]] = {
    Trend: lambda of, screen: TREND + (_trend_keys(screen) if of.keys else 0.0),
    Gauge: _gauge,
    Joints: _joints,
    Table: lambda of, screen: (
        TABLE_FRAME + of.rows_shown * (LOW_ROW if screen.height <= LOW_SCREEN else ROW)
    ),
}

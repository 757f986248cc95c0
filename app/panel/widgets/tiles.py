"""The sizes of widgets' tiles and of a page's parts, as static/css has them, in CSS pixels."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, NamedTuple, Self

from app.panel.widgets.alarm_views import AlarmListView
from app.panel.widgets.displays import Conditions, LogView
from app.panel.widgets.families import BaseWidget
from app.panel.widgets.gauge import Figure, Gauge
from app.panel.widgets.joints import Joints
from app.panel.widgets.parameter import Parameter
from app.panel.widgets.sequence import Sequence
from app.panel.widgets.table import Table
from app.panel.widgets.trend import Trend

WIDE, MIDDLE, NARROW = 1200, 900, 600  # from these widths on a page has all columns, two, one
KEY_MM, ENTRY_MM, GAP_MM = 20.0, 14.0, 5.0
UPRIGHT: Final = 1000  # from this height on a narrow screen has two rows of groups
LOW_SCREEN: Final = 560  # up to this height a row with a cancel key is as low as a touch permits
TOUCH: Final = 44.0  # the least of what is touched
ROW_GAP: Final = 12.0
LABEL_HEIGHT: Final = 25.0  # above an entry
DISPLAY_HEIGHT, LOW_DISPLAY_HEIGHT = 72.0, 66.0
PARAMETER_HEIGHT: Final = 80.0  # name, value and note
PARAMETER_WIDTH: Final = 314.0  # its entry and its key side by side
SLIDER_WIDTH: Final = 200.0
NUMBER_WIDTH: Final = 100.0
DISPLAY_WIDTH: Final = 80.0
NO_NAMES: Final = 620  # up to this height names of figures and plans are only read aloud
FIGURE_HEIGHTS: Final = (
    (NO_NAMES, 95.0, 28.0),
    (560, 70.0, 24.0),
    (0, 46.0, 20.0),
)  # above, number, bar
FIGURE_WIDTH: Final = 190.0
PLACE_WIDTH: Final = 190.0
PLACE_MM: Final = 14.0  # of a place in a list, which scrolls
TOUR_ROW: Final = 36.0
TOUR_FRAME: Final = 50.0  # the line that says how far it is
MAP_WIDTH: Final = 320.0  # its four keys
PLAN_HEIGHT, LOW_PLAN_HEIGHT, PLAN_WIDTH = 144.0, 66.0, 100.0
CONDITIONS_FRAME: Final = 33.0  # the line that says how many are met
CONDITION, LOW_CONDITION = 42.0, 36.0
CONDITIONS_WIDTH: Final = 200.0
SEQUENCE_FRAME: Final = 33.0  # the line above the steps
SEQUENCE_STEP, LOW_SEQUENCE_STEP = 46.0, 40.0
SEQUENCE_PICTURE, LOW_PICTURE = 80.0, 64.0  # above the steps; on a narrow screen it is beside them
SEQUENCE_WIDTH: Final = 240.0
UPRIGHT_GAUGE, LOW_UPRIGHT_GAUGE, LYING_GAUGE = 124.0, 108.0, 92.0
GAUGE_WIDTH: Final = 126.0
JOINTS_FRAME: Final = 41.0  # name and note
JOINT, LOW_JOINT = 34.0, 25.0
JOINTS_WIDTH: Final = 220.0
TABLE_FRAME: Final = 69.0  # name, heads of the columns and note
ROW, LOW_ROW = 36.0, 30.0
TABLE_WIDTH: Final = 280.0
STEP_SIDES: Final = 300.0  # from this width on its value is between its keys, below it above them
PAD_MM: Final = 60.0
ALARM_LIST_FRAME, ALARM_ROW, ALARMS_WIDTH = 33.0, 62.0, 300.0
ALARM_ROWS: Final = 2  # that are seen at least
LOG_HEIGHT, LOG_WIDTH = 100.0, 300.0  # of some lines
PICTURE_HEIGHT, PICTURE_WIDTH = 120.0, 160.0  # the least in which a picture is readable
TREND_HEIGHT, LOW_TREND_HEIGHT = 150.0, 122.0  # names and values of the pens, plot and time axis
TREND_WIDTH: Final = 240.0
TREND_KEYS: Final = 5


@dataclass(frozen=True, slots=True)
class Screen:
    """A screen's size, and its CSS pixels to a millimetre."""

    width: int
    height: int
    mm: float

    @classmethod
    def from_size(cls, size: str, mm_per_px: float) -> Self:
        """From a size like "1280x800"."""
        width, height = map(int, size.split("x"))
        return cls(width, height, 1 / mm_per_px)

    @property
    def is_wide(self) -> bool:
        """Whether all groups stand side by side."""
        return self.width >= WIDE

    @property
    def is_upright(self) -> bool:
        """Whether the first group stays above the others, which take turns."""
        return self.width < MIDDLE and self.height >= UPRIGHT

    @property
    def header(self) -> float:
        """The height of the frame's first line."""
        return 56.0 if self.is_wide else 48.0 if self.width >= MIDDLE else 46.0

    @property
    def rail(self) -> float:
        """The width of the tabs and buttons of the frame, at the side."""
        key = KEY_MM * self.mm
        if self.is_wide:
            return max(88.0, key)
        return max(96.0, key + 5) if self.width >= MIDDLE else max(112.0, key + 8)

    @property
    def pad(self) -> float:
        """At the sides of groups and of what is in them."""
        return 12.0 if self.is_wide else 10.0 if self.width >= MIDDLE else 8.0

    @property
    def pad_above(self) -> float:
        """Above and below groups and what is in them."""
        return 4.0 if self.width < MIDDLE and self.height <= LOW_SCREEN else self.pad

    def touch(self, millimetres: float) -> float:
        """The height of what is touched."""
        return max(TOUCH, millimetres * self.mm)


class Tile(NamedTuple):
    """What the tile of a kind needs, from (widget, screen): the height, with what stands above and
    below it, and the least width in which the widget can be used. `grows`: it takes the height that is
    left, where no widget of the group has `grow`. Narrower than `folds`, it is higher by an entry."""

    height: Callable[[Any, Screen], float]
    width: Callable[[Any, Screen], float]
    grows: bool = False
    folds: float = 0.0

    def height_at(self, widget: BaseWidget, screen: Screen, width: float) -> float:
        """The height at a width."""
        more = screen.touch(ENTRY_MM) if width < self.folds else 0.0
        return self.height(widget, screen) + more


def _key_height(_: BaseWidget, screen: Screen) -> float:
    """Keys have their distance above and below too."""
    return _key(screen, KEY_MM)


def _action_height(_: BaseWidget, screen: Screen) -> float:
    return _key(screen, 0.0 if screen.height <= LOW_SCREEN else KEY_MM)


def _key(screen: Screen, height_mm: float) -> float:
    return screen.touch(height_mm) + GAP_MM * screen.mm - ROW_GAP


def _display_height(_: BaseWidget, screen: Screen) -> float:
    return LOW_DISPLAY_HEIGHT if screen.height <= LOW_SCREEN else DISPLAY_HEIGHT


def _entry_height(_: BaseWidget, screen: Screen) -> float:
    return LABEL_HEIGHT + screen.touch(ENTRY_MM)


def _parameter_height(_: Parameter, screen: Screen) -> float:
    return PARAMETER_HEIGHT + screen.touch(ENTRY_MM)


def _log_height(_: LogView, screen: Screen) -> float:
    return screen.touch(10) + LABEL_HEIGHT + LOG_HEIGHT


def _alarm_list_height(widget: AlarmListView, screen: Screen) -> float:
    return ALARM_LIST_FRAME + min(widget.lines, ALARM_ROWS) * ALARM_ROW


def _gauge_height(gauge: Gauge, screen: Screen) -> float:
    if gauge.orientation == "horizontal":
        return LYING_GAUGE
    return LOW_UPRIGHT_GAUGE if screen.height <= LOW_SCREEN else UPRIGHT_GAUGE


def _figure_height(figure: Figure, screen: Screen) -> float:
    number, bar = next((number, bar) for above, number, bar in FIGURE_HEIGHTS if screen.height > above)
    return number + (bar if figure.has_bar else 0.0)


def _conditions_height(widget: Conditions, screen: Screen) -> float:
    row = LOW_CONDITION if screen.height <= LOW_SCREEN else CONDITION
    return CONDITIONS_FRAME + widget.rows_at_most * row


def _sequence_height(widget: Sequence, screen: Screen) -> float:
    is_low = screen.height <= NO_NAMES
    row = LOW_SEQUENCE_STEP if is_low else SEQUENCE_STEP
    above = widget.has_picture and screen.width >= MIDDLE
    picture = (LOW_PICTURE if is_low else SEQUENCE_PICTURE) if above else 0.0
    return SEQUENCE_FRAME + picture + widget.rows_at_most * row


def _plan_height(_: BaseWidget, screen: Screen) -> float:
    return PLAN_HEIGHT if screen.height > NO_NAMES else LOW_PLAN_HEIGHT


def _joints_height(widget: Joints, screen: Screen) -> float:
    return JOINTS_FRAME + len(widget.joints) * (LOW_JOINT if screen.height <= LOW_SCREEN else JOINT)


def _table_height(table: Table, screen: Screen) -> float:
    return TABLE_FRAME + table.rows_shown * (LOW_ROW if screen.height <= LOW_SCREEN else ROW)


def _trend_height(trend: Trend, screen: Screen) -> float:
    plot = LOW_TREND_HEIGHT if screen.height <= LOW_SCREEN else TREND_HEIGHT
    return plot + (screen.touch(KEY_MM) + 8 if trend.keys else 0.0)


def _trend_width(trend: Trend, screen: Screen) -> float:
    if not trend.keys:
        return TREND_WIDTH
    return (TREND_KEYS * KEY_MM + (TREND_KEYS - 1) * GAP_MM) * screen.mm


def _key_width(_: BaseWidget, screen: Screen) -> float:
    return KEY_MM * screen.mm


DISPLAY: Final = Tile(_display_height, lambda widget, screen: DISPLAY_WIDTH)
KEY: Final = Tile(_key_height, _key_width)
ACTION: Final = Tile(_action_height, lambda widget, screen: (2 * KEY_MM + GAP_MM) * screen.mm)
STEP: Final = Tile(_key_height, lambda widget, screen: 2 * TOUCH + 8, folds=STEP_SIDES)
ENTRY: Final = Tile(_entry_height, _key_width)
NUMBER: Final = Tile(_entry_height, lambda widget, screen: NUMBER_WIDTH)
SLIDER: Final = Tile(_entry_height, lambda widget, screen: SLIDER_WIDTH)
PARAMETER: Final = Tile(_parameter_height, lambda widget, screen: PARAMETER_WIDTH)
JOYSTICK: Final = Tile(
    lambda widget, screen: screen.touch(PAD_MM), lambda widget, screen: PAD_MM * screen.mm
)
LABEL: Final = Tile(lambda widget, screen: LABEL_HEIGHT, lambda widget, screen: DISPLAY_WIDTH)
LOG: Final = Tile(_log_height, lambda widget, screen: LOG_WIDTH, grows=True)
ALARM_LIST: Final = Tile(_alarm_list_height, lambda widget, screen: ALARMS_WIDTH, grows=True)
ALARM_LINE: Final = Tile(lambda widget, screen: screen.header, lambda widget, screen: ALARMS_WIDTH)
CAMERA: Final = Tile(
    lambda widget, screen: PICTURE_HEIGHT, lambda widget, screen: PICTURE_WIDTH, grows=True
)
MAP: Final = Tile(
    lambda widget, screen: 2 * screen.touch(KEY_MM), lambda widget, screen: MAP_WIDTH, grows=True
)
PLACE: Final = Tile(
    lambda widget, screen: LABEL_HEIGHT + (2 + widget.save) * screen.touch(PLACE_MM),
    lambda widget, screen: PLACE_WIDTH,
    grows=True,
)
TOUR: Final = Tile(
    lambda widget, screen: LABEL_HEIGHT + TOUR_FRAME + 2 * TOUR_ROW,
    lambda widget, screen: PLACE_WIDTH,
    grows=True,
)
PALLET: Final = Tile(_plan_height, lambda widget, screen: PLAN_WIDTH, grows=True)
CONDITIONS: Final = Tile(_conditions_height, lambda widget, screen: CONDITIONS_WIDTH)
SEQUENCE: Final = Tile(_sequence_height, lambda widget, screen: SEQUENCE_WIDTH, grows=True)
FIGURE: Final = Tile(_figure_height, lambda widget, screen: FIGURE_WIDTH)
GAUGE: Final = Tile(_gauge_height, lambda widget, screen: GAUGE_WIDTH)
JOINTS: Final = Tile(_joints_height, lambda widget, screen: JOINTS_WIDTH, grows=True)
TABLE: Final = Tile(_table_height, lambda widget, screen: TABLE_WIDTH, grows=True)
TREND: Final = Tile(_trend_height, _trend_width, grows=True)
BUTTONS: Final = (KEY, ACTION, STEP)  # what stands on one line at the end of its group

"""The table of widget kinds: a row for each, with its parts that need no other room."""

from collections.abc import Mapping
from functools import reduce
from operator import or_
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal, NamedTuple, TypeVar

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler, ValidationInfo
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import core_schema

from app.panel.widgets import tiles
from app.panel.widgets.alarm_views import AlarmLineView, AlarmListView
from app.panel.widgets.displays import (
    Camera,
    Conditions,
    Indicator,
    LogView,
    PageLink,
    Pallet,
    Picture,
    Readout,
    TextLabel,
)
from app.panel.widgets.families import BaseWidget
from app.panel.widgets.gauge import Figure, Gauge
from app.panel.widgets.hold import Hold, Joystick
from app.panel.widgets.inputs import SelectInput, TextInput, ToggleInput
from app.panel.widgets.joints import Joints
from app.panel.widgets.map_view import MapView
from app.panel.widgets.numbers import NumberInput, SliderInput
from app.panel.widgets.parameter import Parameter
from app.panel.widgets.place import PlaceInput
from app.panel.widgets.publish import Publish, Step
from app.panel.widgets.sequence import Sequence
from app.panel.widgets.service_action import Action, Call
from app.panel.widgets.switch import Switch
from app.panel.widgets.table import Table
from app.panel.widgets.tiles import Tile
from app.panel.widgets.tour import Tour
from app.panel.widgets.trend import Trend
from app.system.errors import KindError

Stylesheet = Literal["entries", "marks", "facts", "alarm-rows", "own"]
Script = Literal["entries", "facts", "holds"]


class WidgetKind(NamedTuple):
    """A kind of widgets.

    `model` has its keys and their checks, `tile` the size that it needs on a page. `styles` are the
    stylesheets of a page with the kind: "own" is `css/kinds/<kind>.css`, the others are shared by
    several kinds. `script`: whether it has a script, `js/kinds/<kind>.js`, or the name of one that
    several kinds share. Its template is `widgets/<kind>.html`. How a kind is shown, judged, sent and
    simulated is in a table of each of the rooms above; `require_rows` checks them.
    """

    model: type[BaseWidget]
    tile: Tile
    styles: tuple[Stylesheet, ...] = ()
    script: bool | Script = False


KINDS: Final[Mapping[str, WidgetKind]] = {
    "text": WidgetKind(TextInput, tiles.ENTRY, styles=("entries",)),
    "number": WidgetKind(NumberInput, tiles.NUMBER, styles=("entries",)),
    "slider": WidgetKind(SliderInput, tiles.SLIDER, styles=("entries",)),
    "select": WidgetKind(SelectInput, tiles.ENTRY, styles=("entries",), script="entries"),
    "toggle": WidgetKind(ToggleInput, tiles.ENTRY, styles=("entries",)),
    "publish": WidgetKind(Publish, tiles.KEY),
    "hold": WidgetKind(Hold, tiles.KEY, script="holds"),
    "step": WidgetKind(Step, tiles.STEP, styles=("own",), script=True),
    "switch": WidgetKind(Switch, tiles.ENTRY, styles=("entries",), script="entries"),
    "joystick": WidgetKind(Joystick, tiles.JOYSTICK, styles=("own",), script="holds"),
    "call": WidgetKind(Call, tiles.KEY),
    "action": WidgetKind(Action, tiles.ACTION),
    "parameter": WidgetKind(Parameter, tiles.PARAMETER, styles=("entries", "own"), script="entries"),
    "readout": WidgetKind(Readout, tiles.DISPLAY),
    "indicator": WidgetKind(Indicator, tiles.DISPLAY),
    "figure": WidgetKind(Figure, tiles.FIGURE, styles=("facts",)),
    "pallet": WidgetKind(Pallet, tiles.PALLET, styles=("facts",), script="facts"),
    "conditions": WidgetKind(Conditions, tiles.CONDITIONS, styles=("facts",), script="facts"),
    "sequence": WidgetKind(Sequence, tiles.SEQUENCE, styles=("facts",), script="facts"),
    "gauge": WidgetKind(Gauge, tiles.GAUGE, styles=("marks", "own"), script=True),
    "joints": WidgetKind(Joints, tiles.JOINTS, styles=("marks", "own"), script=True),
    "table": WidgetKind(Table, tiles.TABLE, styles=("own",), script=True),
    "camera": WidgetKind(Camera, tiles.CAMERA, styles=("own",), script=True),
    "map": WidgetKind(MapView, tiles.MAP, styles=("own",), script=True),
    "place": WidgetKind(PlaceInput, tiles.PLACE, styles=("entries", "own"), script=True),
    "tour": WidgetKind(Tour, tiles.TOUR, styles=("own",), script=True),
    "log": WidgetKind(LogView, tiles.LOG, styles=("own",), script=True),
    "trend": WidgetKind(Trend, tiles.TREND, styles=("own",), script=True),
    "alarm_list": WidgetKind(
        AlarmListView, tiles.ALARM_LIST, styles=("alarm-rows", "own"), script=True
    ),
    "alarm_line": WidgetKind(AlarmLineView, tiles.ALARM_LINE, styles=("own",), script=True),
    "label": WidgetKind(TextLabel, tiles.LABEL),
    "image": WidgetKind(Picture, tiles.DISPLAY),
    "link": WidgetKind(PageLink, tiles.KEY),
}


class ByKind:
    """Checks a widget's table by the model of its "kind". A model is built at the first table of its
    kind: a union would build all, and Pydantic takes up to 3 ms for one."""

    @staticmethod
    def __get_pydantic_core_schema__(
        source: Any, handler: GetCoreSchemaHandler
    ) -> core_schema.CoreSchema:
        return _tagged({name: _checked_later(kind.model) for name, kind in KINDS.items()})

    @staticmethod
    def __get_pydantic_json_schema__(
        schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        return handler(_tagged({name: _built_schema(kind.model) for name, kind in KINDS.items()}))


def _tagged(choices: dict[Any, core_schema.CoreSchema]) -> core_schema.CoreSchema:
    return core_schema.tagged_union_schema(choices, discriminator="kind")


def _checked_later(model: type[BaseWidget]) -> core_schema.CoreSchema:
    """The schema of a model that is built when a table is checked by it."""

    def checked(value: Any, info: ValidationInfo) -> Any:
        return model.__pydantic_validator__.validate_python(value, context=info.context)

    return core_schema.with_info_plain_validator_function(checked)


def _built_schema(model: type[BaseWidget]) -> core_schema.CoreSchema:
    """The whole schema of a model."""
    model.model_rebuild()
    return model.__pydantic_core_schema__


# The description of a widget's table, by its "kind".
if TYPE_CHECKING:
    Widget = BaseWidget
else:
    Widget = Annotated[reduce(or_, (kind.model for kind in KINDS.values())), ByKind]

Row = TypeVar("Row")


def find_row(rows: Mapping[type[Any], Row], widget: BaseWidget) -> Row:
    """The row of a widget's kind in a table by kinds and families, else that of its nearest family.
    KindError without one."""
    return _nearest_row(rows, type(widget), widget.kind, "row in a table of kinds")


def require_rows(part: str, rows: Mapping[type[Any], Any], family: type[BaseWidget]) -> None:
    """Checks a table by kinds and families: each kind of `family` has a row. KindError names the kind
    and the `part` that it lacks."""
    for name, kind in KINDS.items():
        if issubclass(kind.model, family):
            _nearest_row(rows, kind.model, name, part)


def _nearest_row(rows: Mapping[type[Any], Row], model: type[BaseWidget], name: str, part: str) -> Row:
    for family in model.__mro__:
        if family in rows:
            return rows[family]
    raise KindError(name, part, f"add a row for {model.__name__} or its family")

"""Keys that several tables of the panel file take: in each table they have one type, one check and one
effect."""

import copy
import math
import tomllib
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Final, NamedTuple, Union, get_args, get_origin

import pytest
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from app.cell.alarms.sources import read_source, read_suppression
from app.cell.permission.conditions import condition_state, condition_verdict
from app.cell.permission.interlocks import link_verdict
from app.cell.recipes.reported import reported_fields
from app.cell.robot.map_layers import read_shape
from app.cell.robot.maps import read_grid
from app.cell.robot.state import RobotState
from app.cell.robot.topics import CameraTopicState
from app.cell.view.displays import field_state
from app.cell.view.kinds import attributes_of
from app.cell.view.overview import TileFigure, figure_now
from app.panel import Panel, load_panel
from app.panel.file.keys import inner_model
from app.panel.file.load import faults_of_text
from app.panel.file.same_widgets import NAME as SAME
from app.panel.reference import schema
from app.panel.shared_keys import AgeKey, FieldKeys, NeedsKey, NumberKeys, RobotKey, RobotsKey
from app.panel.widgets.displays import Readout, StatesKey
from app.panel.widgets.families import BaseWidget, Command
from app.panel.widgets.key_parts import ConfirmationKeys
from app.panel.widgets.kinds import KINDS
from app.panel.widgets.service_action import ServerCommand
from app.panel.widgets.table import Table
from app.ros.zenoh.sample import Sample
from app.system.toml_values import value_text
from tests.cell.view.test_map_values import INFO, moved
from tests.support.beside_panel import put_beside
from tests.support.builders import BRIDGE, INTERFACES, NOW, endpoint, robot_there
from tests.support.parts import TESTS
from tests.support.words import english

EVERYTHING: Final = tomllib.loads((TESTS / "everything.toml").read_text())
MODELS: Final = schema.models()
BOOL: Final = "std_msgs/msg/Bool"
FLOAT: Final = "std_msgs/msg/Float64"
INT: Final = "std_msgs/msg/Int32"

# Each shared key, with the class that has it, or with several the types that it may have.
ONE: Final[Mapping[str, tuple[type[BaseModel], ...]]] = {
    **dict.fromkeys(("topic", "type", "qos", "field"), (FieldKeys,)),
    "max_age_s": (AgeKey,),
    **dict.fromkeys(("unit", "scale", "offset"), (NumberKeys,)),
    "format": (NumberKeys, Readout),  # a time too
    "robot": (RobotKey,),
    "robots": (RobotsKey,),
    "needs": (NeedsKey,),
    **dict.fromkeys(("span", "rows", "grow", "show_label"), (BaseWidget,)),
    "interlocks": (Command,),
    **dict.fromkeys(("confirm_press", "consequence"), (ConfirmationKeys,)),
    "states": (StatesKey,),
    "constants": (Readout,),
    "entries_read": (Table,),
    "timeout_s": (ServerCommand,),
}
# Where a key of the same name is another one, by key: the tables.
OTHERS: Final[Mapping[str, frozenset[str]]] = {
    "topic": frozenset(),
    "type": frozenset(
        {
            "options_from",
            "switch",
            "recipe",
            "call",
            "action",
            "parameter",
            "camera",
            "map",
            "pose",
            "log_widget",
        }
    ),
    "field": frozenset({"options_from", "list", "table", "column", "joints"}),
    "max_age_s": frozenset({"oidc"}),
    "unit": frozenset({"joint"}),
    "scale": frozenset({"number", "slider"}),
    "offset": frozenset({"number", "slider"}),
    "interlocks": frozenset({"panel"}),
    "consequence": frozenset({"alarm"}),
    "robots": frozenset({"panel"}),
}
# Those whose type is that of a service, too: the reference says the same of both.
OF_SERVICES: Final = frozenset({"options_from", "switch", "recipe"})


def one_type(field: FieldInfo) -> tuple[Any, list[str]]:
    """What a key takes where it is there, with its checks."""
    annotation, checks = field.annotation, list(field.metadata)
    while True:
        inner = [each for each in get_args(annotation) if each is not NoneType]
        if get_origin(annotation) in (Union, UnionType) and len(inner) == 1:
            annotation = inner[0]
        elif get_origin(annotation) is Annotated:
            annotation, *more = get_args(annotation)
            checks += more
        else:
            break
    flat = (each for check in checks for each in getattr(check, "metadata", (check,)))
    return annotation, sorted(map(repr, flat))


@pytest.mark.parametrize("key", ONE)
def test_a_key_has_one_type_and_one_meaning_in_each_table(key: str) -> None:
    types = [one_type(model.model_fields[key]) for model in ONE[key]]
    fields = {
        name: model.model_fields[key] for name, model in MODELS.items() if key in model.model_fields
    }
    others = {name for name, field in fields.items() if one_type(field) not in types}
    assert others == OTHERS.get(key, frozenset())
    for name in fields:
        written = fields[name].alias or key
        if name in others - OF_SERVICES:
            assert schema.said_at(name, written) != schema.ANY, name


def test_no_meaning_is_written_twice() -> None:
    said = [
        (key, text)
        for section, keys in schema.WORDS.items()
        if section not in ("tables", "examples")
        for key, text in keys.items()
    ]
    assert [each for each in said if said.count(each) > 1] == []


# The same mistake in each table that takes the key: the same finding.


def tables_of(
    tables: Any, model: type[BaseModel], name: str, place: str
) -> Iterator[tuple[str, str, Any]]:
    """(name, place, table) of each table of a panel file."""
    kind = tables.get("kind")
    if isinstance(kind, str) and kind in KINDS:
        model, name = KINDS[kind].model, schema.of_kind(kind) or name
    yield name, place, tables
    for key, value in tables.items():
        inner = inner_model(model, key)
        for number, part in enumerate(value if isinstance(value, list) else [value]):
            at = f"{place}.{key}".strip(".") + (f"[{number}]" if isinstance(value, list) else "")
            if isinstance(part, dict) and inner is not None and SAME not in part and key != "demo":
                yield from tables_of(part, inner, key, at)


def firsts(panel: Mapping[str, Any]) -> dict[str, tuple[str, Any]]:
    """Name → (place, table) of the first table of each name."""
    named: dict[str, tuple[str, Any]] = {}
    for name, place, table in tables_of(panel, Panel, schema.ROOT, ""):
        named.setdefault(name, (place, table))
    return named


def text_of(panel: Mapping[str, Any]) -> str:
    return "".join(f"{key} = {value_text(value)}\n" for key, value in panel.items())


def put_interfaces(folder: Path) -> None:
    """Puts what everything.toml names beside a panel file."""
    messages = folder / "msgs/cell_msgs/msg"
    messages.mkdir(parents=True)
    (messages / "Jog.msg").write_text("float64 speed\nuint32 valid_ms\nuint16 number\n")
    put_beside(folder)


WRONG: Final[list[tuple[str, Any, str, str]]] = [
    ("max_age_s", 0, "", "must be more than 0, not 0"),
    ("max_age_s", -1.5, "", "must be more than 0, not -1.5"),
    ("max_age_s", 1e6, "", "must be 86400 or less, not 1000000.0"),
    ("topic", "air pressure", "", '"air pressure" is not an absolute ROS 2 topic name'),
    ("type", "Float64", "", '"Float64" is not a ROS 2 message type: it must be like std_msgs/msg/Bool'),
    ("qos", {"depth": 0}, ".depth", "must be 1 or more, not 0"),
    ("field", "a b", "", "a b"),
    ("scale", math.nan, "", "must be a finite number, not nan"),
    ("offset", "1", "", 'must be a number, not "1"'),
    ("unit", "x" * 21, "", "must be 20 characters at most; it has 21"),
    ("format", "0.1", "", '"0.1" is not a format'),
    ("robot", "Robot 1", "", '"Robot 1" is not an id'),
    ("needs", "The boss", "", '"The boss" is not an id'),
    ("span", 13, "", "must be 12 or less, not 13"),
    ("rows", 0, "", "must be 1 or more, not 0"),
    ("entries_read", 0, "", "must be 1 or more, not 0"),
    ("timeout_s", 0, "", "must be more than 0, not 0"),
    ("states", [], "", "is empty: it must have one at least"),
    ("confirm_press", "pins", "", 'must be true, false, "pin" or "two_persons", not "pins"'),
]


@pytest.mark.parametrize(("key", "value", "below", "words"), WRONG, ids=lambda value: str(value)[:12])
def test_a_wrong_value_has_one_finding_in_each_table(
    tmp_path: Path, key: str, value: Any, below: str, words: str
) -> None:
    put_interfaces(tmp_path)
    messages: dict[str, str] = {}
    for is_source in (True, False):  # faults of sources are reported alone
        panel = copy.deepcopy(EVERYTHING)
        places = {}
        for name, (place, table) in firsts(panel).items():
            others = OTHERS.get(key, frozenset()) - OF_SERVICES
            takes = key in MODELS[name].model_fields and name not in others
            if takes and (name == "source") == is_source:
                table[key] = value
                places[f"{place}.{key}{below}"] = name
        faults = {fault.place: fault.message for fault in faults_of_text(text_of(panel), tmp_path)}
        messages |= {name: faults.get(place, "") for place, name in places.items()}
    assert [name for name, message in messages.items() if words not in message] == []
    assert len({*messages.values()}) == 1


@pytest.mark.parametrize(
    ("key", "words"),
    [
        ("robot", 'no robot "{}"; there is r1, r2'),
        ("needs", '"{}" is neither a role nor a group: there is viewer, operator, maintenance, '),
        ("interlocks", 'no interlock "{}"; there is operation'),
        ("picture", 'no picture "{}" in the folder `pictures`; there is '),
    ],
)
def test_an_unknown_name_has_one_finding_in_each_table(tmp_path: Path, key: str, words: str) -> None:
    put_interfaces(tmp_path)
    panel = copy.deepcopy(EVERYTHING)
    places: dict[str, str] = {}
    for number, (name, (place, table)) in enumerate(firsts(panel).items()):
        if key in MODELS[name].model_fields and name not in OTHERS.get(key, ()):
            unknown = f"x{number}.png" if key == "picture" else f"xyz{number}"
            written = MODELS[name].model_fields[key].alias or key
            table[written] = unknown
            places[f"{place}.{written}"] = words.format(unknown)
    messages = {fault.place: fault.message for fault in faults_of_text(text_of(panel), tmp_path)}
    assert [at for at, said in places.items() if not messages.get(at, "").startswith(said)] == []


# What only the types tell, and what a key does: with a small panel for each table.

Keys = Mapping[str, Any]
STATES: Final = [{"value": 0, "text": "Low", "shape": "square"}]
GO: Final = {
    "id": "go",
    "kind": "publish",
    "label": "Go",
    "topic": "/go",
    "type": FLOAT,
    "message": {"data": 1.0},
}
SWITCH: Final = {
    "topic": "/set",
    "type": BOOL,
    "on_message": {"data": True},
    "off_message": {"data": False},
}
LEVELS: Final = [{"id": "l0", "label": "L0", "topic": "/l0", "value": 0}]
STEP: Final = {
    "topic": "/set",
    "type": FLOAT,
    "message": {"data": "{value}"},
    "min": 0,
    "max": 9,
    "step": 1,
}
LENGTH: Final = {"id": "length", "kind": "number", "label": "L", "min": 0.0, "max": 9.0}


def on_page(*widgets: Keys, **tables: Any) -> dict[str, Any]:
    return {"title": "C", **tables, "page": [{"id": "one", "title": "One", "widget": [*widgets]}]}


def widget(kind: str, **more: Any) -> Callable[[Keys], dict[str, Any]]:
    return lambda keys: on_page({"id": "w", "kind": kind, "label": "W", **more, **keys})


def within(key: str, kind: str, **more: Any) -> Callable[[Keys], dict[str, Any]]:
    """A table `key` of a widget, which reads another topic."""
    own = {"topic": "/b", "type": FLOAT} if kind in ("figure", "gauge") else {}
    return lambda keys: on_page({"id": "w", "kind": kind, "label": "W", **own, **more, key: dict(keys)})


def alarm(keys: Keys) -> dict[str, Any]:
    return on_page(GO, alarm=[{"id": "a", "text": "A", **keys}])


class Row(NamedTuple):
    """A table at a place of a panel, which reads a topic of a type."""

    panel: Callable[[Keys], dict[str, Any]]
    place: str = "page[0].widget[0]"
    type: str = FLOAT


IN_WIDGET: Final = "page[0].widget[0]"
ROWS: Final[Mapping[str, Row]] = {
    "interlock": Row(
        lambda keys: on_page({**GO, "interlock": "c"}, interlock=[{"id": "c", "min": 1.0, **keys}]),
        "interlock[0]",
    ),
    "condition": Row(
        lambda keys: on_page(GO, condition=[{"id": "c", "min": 1.0, **keys}]), "condition[0]"
    ),
    "alarm": Row(lambda keys: alarm({"low": 1.0, **keys}), "alarm[0]"),
    "when": Row(lambda keys: alarm({"when": {"min": 1.0, **keys}}), "alarm[0].when"),
    "while": Row(
        lambda keys: alarm({"lost": "link", "while": {"min": 1.0, **keys}}), "alarm[0].while"
    ),
    "overview": Row(
        lambda keys: on_page(GO, robot=[{"id": "r", "name": "R", "overview": dict(keys)}]),
        "robot[0].overview",
    ),
    "state": Row(lambda keys: on_page(GO, state={"states": STATES, **keys}), "state", INT),
    "detail": Row(
        lambda keys: on_page(
            GO, state={"topic": "/s", "type": INT, "states": STATES, "detail": [dict(keys)]}
        ),
        "state.detail[0]",
    ),
    "counter": Row(
        lambda keys: on_page(
            GO,
            state={"topic": "/s", "type": INT, "states": STATES},
            oee={"running": [0], "counter": [{"parts": "good", **keys}]},
        ),
        "oee.counter[0]",
    ),
    "readout": Row(widget("readout")),
    "indicator": Row(widget("indicator", states=STATES), type=INT),
    "figure": Row(widget("figure")),
    "target": Row(within("target", "figure"), f"{IN_WIDGET}.target"),
    "line": Row(
        lambda keys: widget(
            "figure", topic="/b", type=FLOAT, line=[{"text": "{value} left", **keys}]
        )({}),
        f"{IN_WIDGET}.line[0]",
    ),
    "pallet": Row(widget("pallet", across=2, along=2), type=INT),
    "gauge": Row(widget("gauge", min=0, max=9)),
    "setpoint": Row(within("setpoint", "gauge", min=0, max=9), f"{IN_WIDGET}.setpoint"),
    "pen": Row(
        lambda keys: widget("trend", pen=[{"label": "P", **keys}])({}),
        f"{IN_WIDGET}.pen[0]",
    ),
    "lamp": Row(
        lambda keys: on_page({**GO, "lamp": {"states": STATES, **keys}}), f"{IN_WIDGET}.lamp", INT
    ),
    "confirm": Row(
        lambda keys: on_page({**GO, "confirm": {"equals": 1.0, **keys}}), f"{IN_WIDGET}.confirm"
    ),
    "current": Row(
        within("current", "sequence", steps=[{"text": "A"}, {"text": "B"}]), f"{IN_WIDGET}.current", INT
    ),
    "robot_level": Row(within("robot_level", "map", level=LEVELS), f"{IN_WIDGET}.robot_level", INT),
    "value": Row(within("value", "step", **STEP), f"{IN_WIDGET}.value"),
    "reported": Row(within("reported", "switch", **SWITCH), f"{IN_WIDGET}.reported", BOOL),
}  # fmt: skip
# Those that read no field of one value: they are in the test of age.
OF_TOPICS: Final = frozenset(
    {"source", "joints", "table", "camera", "map", "pose", "log_widget", "options_from", "readback"}
)
# Those that only publish.
PUBLISHED: Final = frozenset({"publish", "hold", "step", "joystick", "switch", "recipe"})
NUMBERS: Final = [name for name in ROWS if "scale" in MODELS[name].model_fields]
# Those that take a text where they need no number.
OF_TEXTS: Final = ("interlock", "condition", "when", "while", "overview", "readout", "line")


def test_each_table_that_reads_a_topic_has_a_row() -> None:
    reading = {name for name, model in MODELS.items() if {"topic", "type"} <= {*model.model_fields}}
    assert reading == {*ROWS, *OF_TOPICS, *PUBLISHED}


def findings(folder: Path, name: str, **keys: Any) -> dict[str, str]:
    """Key → message of the faults in a table with these keys."""
    row = ROWS[name]
    text = text_of(row.panel({"topic": "/air", "type": row.type, **keys}))
    faults = faults_of_text(text, folder)
    return {fault.place.removeprefix(f"{row.place}."): fault.message for fault in faults}


@pytest.mark.parametrize("name", ROWS)
def test_a_field_has_one_finding_in_each_table(tmp_path: Path, name: str) -> None:
    assert findings(tmp_path, name) == {}
    unknown = findings(tmp_path, name, type="std_msgs/msg/Flaot64")
    assert unknown == {
        "type": '"std_msgs/msg/Flaot64" is not an interface of ROS 2 jazzy; did you mean '
        "std_msgs/msg/Float64?"
    }
    lacking = findings(tmp_path, name, field="dta")
    kind = ROWS[name].type
    assert lacking == {"field": f'there is no "dta" (in "dta"): {kind} has data'}
    whole = findings(tmp_path, name, type="geometry_msgs/msg/PoseStamped", field="pose")
    first, _, rest = whole["field"].partition(" takes one value of it, not all; ")
    assert first.startswith('"pose" is geometry_msgs/msg/Pose: a'), whole
    assert rest == "write pose.position or pose.orientation"


TOPIC: Final = {"topic": "/air", "type": "std_srvs/srv/Trigger"}
SERVICE: Final = {"service": "/air", "type": FLOAT}
LOAD: Final = {"id": "box", "label": "B", "fields": ["length"]}


@pytest.mark.parametrize(("keys", "kind"), [(TOPIC, "topic"), (SERVICE, "service")])
def test_a_type_of_the_other_way_has_one_finding(tmp_path: Path, keys: Keys, kind: str) -> None:
    sent = "request" if kind == "service" else "message"
    reported = {"topic": "/b", "type": BOOL}
    positions = {f"{name}_{sent}": {"data": name == "on"} for name in ("on", "off")}
    panels = [
        widget("switch", reported=reported, **positions)(keys),
        widget("select", options_from=dict(keys))({}),
        on_page(LENGTH, recipe=[{**LOAD, **keys, sent: {"data": "{length}"}}]),
    ]
    for panel in panels:
        (fault,) = faults_of_text(text_of(panel), tmp_path)
        assert fault.message.startswith(
            f'"{keys["type"]}" is no type of a {kind}: it must be like std_'
        )
        assert fault.place.endswith(".type")


@pytest.mark.parametrize("name", NUMBERS)
def test_a_scale_of_zero_has_one_finding_in_each_table(tmp_path: Path, name: str) -> None:
    assert findings(tmp_path, name, scale=0) == {"scale": "is 0: every value would be the same"}


@pytest.mark.parametrize("name", [name for name in ROWS if "format" in MODELS[name].model_fields])
def test_a_format_of_whole_numbers_has_one_finding_in_each_table(tmp_path: Path, name: str) -> None:
    messages = findings(tmp_path, name, format="d")
    assert messages == {"format": '"d" is for whole numbers; this is float64'}


@pytest.mark.parametrize("name", OF_TEXTS)
def test_keys_of_numbers_have_one_finding_beside_a_text(tmp_path: Path, name: str) -> None:
    for key, value in {"unit": "m", "scale": 2.0, "offset": 1.0, "format": ".1f"}.items():
        if key in MODELS[name].model_fields:
            compared = {"equals": "on"} if "equals" in MODELS[name].model_fields else {}
            messages = findings(tmp_path, name, type="std_msgs/msg/String", **compared, **{key: value})
            assert messages[key] == 'is for numbers; "data" is string'


# What a value is worth after `max_age_s`, and which number counts with `scale` and `offset`.

JOINTS: Final = "sensor_msgs/msg/JointState"
LIST: Final = "std_msgs/msg/Float64MultiArray"
IMAGE: Final = "sensor_msgs/msg/Image"
GRID: Final = "nav_msgs/msg/OccupancyGrid"
PATH: Final = "nav_msgs/msg/Path"
AGED: Final[Mapping[str, Row]] = {
    **{name: row for name, row in ROWS.items() if "max_age_s" in MODELS[name].model_fields},
    "trend": Row(
        lambda keys: widget(
            "trend",
            max_age_s=keys["max_age_s"],
            pen=[{"topic": "/air", "type": FLOAT, "label": "P"}],
        )({})
    ),
    "joints": Row(widget("joints", joint=[{"name": "a", "min": 0, "max": 9}]), type=JOINTS),
    "table": Row(
        widget("table", field="data", column=[{"label": "N"}]), type=LIST
    ),
    "camera": Row(widget("camera"), type=IMAGE),
    "map": Row(widget("map"), type=GRID),
    "layer": Row(
        lambda keys: widget(
            "map",
            layer=[{"shows": "path", "topic": keys["topic"], "max_age_s": keys["max_age_s"]}],
        )({}),
        type=PATH,
    ),
    "options_from": Row(within("options_from", "select"), type=JOINTS),
    "readback": Row(
        lambda keys: on_page(
            LENGTH,
            recipe=[
                {"id": "box", "label": "B", "fields": ["length"], "topic": "/load", "type": FLOAT}
                | {"message": {"data": "{length}"}}
                | {"readback": {"fields": {"length": "data"}, **keys}}
            ],
        )
    ),
}  # fmt: skip
SENT: Final[Mapping[str, Any]] = {
    JOINTS: {"name": ["a"], "position": [1.0]},
    LIST: {"data": [2.0]},
    BOOL: {"data": True},
    INT: {"data": 0},
    IMAGE: {},
    GRID: {"header": {"frame_id": "map"}, "info": INFO, "data": [0, 100]},
    PATH: {"header": {"frame_id": "map"}, "poses": [{}, {}]},
}
MORE: Final[Mapping[str, Keys]] = {"options_from": {"field": "name"}}


CELLS: Final[Mapping[str, Row]] = {
    **ROWS,
    **AGED,
    "column": Row(
        lambda keys: on_page(
            {"id": "w", "kind": "table", "label": "W", "topic": "/air", "type": LIST, "field": "data"}
            | {"column": [{"label": "N", "scale": keys["scale"], "offset": keys["offset"]}]}
        ),
        type=LIST,
    ),
}


def cell(folder: Path, name: str, **keys: Any) -> tuple[Panel, RobotState]:
    """A panel with the table, and a robot that published its topic at `NOW`."""
    row = CELLS[name]
    table = {"topic": "/air", "type": row.type, **MORE.get(name, {}), **keys}
    path = folder / "cell.toml"
    path.write_text(text_of(row.panel(table)))
    panel = load_panel(path)
    robot = robot_there(panel)
    for topic, kind in {"/air": row.type, "/b": FLOAT}.items():
        endpoint(robot, "MP", topic, kind)
        fields = {"data": 8.0} if topic == "/b" else SENT.get(kind, {"data": 2.0})
        sample = Sample(INTERFACES.encode(kind, fields), 1, NOW, NOW, BRIDGE)
        robot.update(robot.key(topic), sample)
        if kind == LIST:
            robot.table_entries.record_sample(robot.key(topic), sample)
        if kind == GRID:
            robot.maps[robot.key(topic)].grid = read_grid(INTERFACES, bytes(sample.payload))
            moved(robot, 1.0)
        if kind == PATH:
            robot.maps["map"].grid = read_grid(INTERFACES, INTERFACES.encode(GRID, SENT[GRID]))
            layer = robot.map_layers[robot.key(topic)]
            layer.shape, layer.at = read_shape(INTERFACES, PATH, bytes(sample.payload)), NOW
    robot.camera_topics[robot.key("/air")] = CameraTopicState(NOW, 0.0)
    return panel, robot


def shown(panel: Panel, robot: RobotState, now: float) -> dict[str, Any]:
    """The attributes of the first widget."""
    attributes: dict[str, Any] = english(attributes_of(panel.pages[0].widgets[0], robot, now)[0])
    return attributes


def state_shown(panel: Panel, robot: RobotState, now: float) -> dict[str, Any]:
    assert panel.state is not None
    attributes: dict[str, Any] = english(attributes_of(panel.state.display, robot, now)[0])
    return attributes


def figure(panel: Panel, robot: RobotState, now: float) -> TileFigure:
    """The figure of the first robot."""
    readout = panel.robots[0].figure
    assert readout is not None
    return figure_now(readout, robot, now)


Known = Callable[[Panel, RobotState, float], bool]
# Whether a table's value counts; of all others the state of the widget says it.
KNOWN: Final[Mapping[str, Known]] = {
    "counter": lambda panel, robot, now: panel.oee is not None
    and field_state(panel.oee.counters[0], robot, now).state == "live",
    **dict.fromkeys(
        ("interlock", "condition"),
        lambda panel, robot, now: condition_verdict(
            panel.named_conditions[0], robot, now, link_verdict(robot, now)
        ).permitted,
    ),
    **dict.fromkeys(
        ("alarm", "when"),
        lambda panel, robot, now: read_source(panel.alarms[0], robot, now, 0.0).is_known,
    ),
    "while": lambda panel, robot, now: read_suppression(panel.alarms[0], robot, now).is_known,
    "overview": lambda panel, robot, now: figure(panel, robot, now)["live"],
    "state": lambda panel, robot, now: state_shown(panel, robot, now)["state"] == "live",
    "detail": lambda panel, robot, now: state_shown(panel, robot, now)["detail0"] == "2",
    "target": lambda panel, robot, now: shown(panel, robot, now)["part"] is not None,
    "line": lambda panel, robot, now: shown(panel, robot, now)["line0"] == "2 left",
    "setpoint": lambda panel, robot, now: shown(panel, robot, now)["setpoint"] is not None,
    "layer": lambda panel, robot, now: shown(panel, robot, now)["layer_0"]["state"] == "live",
    "robot_level": lambda panel, robot, now: shown(panel, robot, now)["level"] == "l0",
    "reported": lambda panel, robot, now: shown(panel, robot, now)["at"] == "on",
    "readback": lambda panel, robot, now: reported_fields(panel.recipe_loads[0], robot, now)[
        "length"
    ].is_known,
}  # fmt: skip


@pytest.mark.parametrize("name", AGED)
def test_a_value_counts_until_it_is_as_old_as_its_limit(tmp_path: Path, name: str) -> None:
    def known(panel: Panel, robot: RobotState, now: float) -> bool:
        return bool(shown(panel, robot, now)["state"] == "live")

    counts = KNOWN.get(name, known)
    panel, robot = cell(tmp_path, name, max_age_s=1.0)
    assert [counts(panel, robot, NOW + age) for age in (0.0, 0.9, 1.0, 5.0)] == [
        True,
        True,
        False,
        False,
    ]


def test_each_table_with_an_age_has_a_row() -> None:
    aged = {name for name, model in MODELS.items() if "max_age_s" in model.model_fields}
    # A tour has the feedback of actions: tests/cell/view/test_tour_values.py.
    assert aged - {"source", "oidc", "tour"} == {*AGED}


def condition_text(panel: Panel, robot: RobotState) -> Any:
    """The number that a condition compares, as a sentence has it."""
    link = link_verdict(robot, NOW)
    return english(condition_state(panel.named_conditions[0], robot, NOW, link).value)


# The number of a table with `scale` and `offset`, as it is shown, or as it is compared.
SHOWN: Final[Mapping[str, Callable[[Panel, RobotState], Any]]] = {
    **dict.fromkeys(("interlock", "condition"), condition_text),
    "alarm": lambda panel, robot: read_source(panel.alarms[0], robot, NOW, 0.0).value,
    "when": lambda panel, robot: read_source(panel.alarms[0], robot, NOW, 0.0).met,
    "while": lambda panel, robot: read_suppression(panel.alarms[0], robot, NOW).met,
    "overview": lambda panel, robot: figure(panel, robot, NOW)["number"],
    **dict.fromkeys(
        ("readout", "figure", "gauge"), lambda panel, robot: shown(panel, robot, NOW)["text"]
    ),
    "target": lambda panel, robot: shown(panel, robot, NOW)["rest"],
    "line": lambda panel, robot: shown(panel, robot, NOW)["line0"],
    "setpoint": lambda panel, robot: shown(panel, robot, NOW)["target"],
    "pen": lambda panel, robot: shown(panel, robot, NOW)["text0"],
    "column": lambda panel, robot: shown(panel, robot, NOW)["table_rows"][0]["cells"][0]["text"],
}  # fmt: skip


@pytest.mark.parametrize("name", SHOWN)
def test_a_scaled_number_is_shown_and_compared_in_each_table(tmp_path: Path, name: str) -> None:
    limits = {"when": {"min": 7.0}, "while": {"min": 7.0}}
    panel, robot = cell(tmp_path, name, scale=3.0, offset=1.0, **limits.get(name, {}))
    assert str(SHOWN[name](panel, robot)) in ("7", "7.0", "7 left", "set 7", "/ 7", "True")
    panel, robot = cell(tmp_path, name, scale=3.0, offset=0.5, **limits.get(name, {}))
    assert str(SHOWN[name](panel, robot)) in ("6.5", "6.5 left", "set 6.5", "/ 6.5", "False")


def test_each_table_with_a_scale_has_a_row() -> None:
    scaled = {name for name, model in MODELS.items() if "scale" in model.model_fields}
    assert scaled - {"source", "number", "slider"} == {*SHOWN}

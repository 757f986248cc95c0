"""What a panel can have of an item of the robot's list, and the edits that write it."""

import tomllib
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Final

import pytest

from app.panel.file.load import faults_of_text
from app.ros.graph.model import EndpointQos, Server, SurveyedTopic, TopicEndpoint
from app.ros.graph.node_services import NodeParameter
from app.ros.messages import load_interfaces
from app.system.texts import render
from app.system.toml_values import value_text
from app.tools.editor.suggestions import Item, Suggestion, drop_of, suggestions_for

INTERFACES: Final = load_interfaces("jazzy")
BOOL: Final = "std_msgs/msg/Bool"
FILE: Final = """title = "Cell"

[[interlock]]
id = "ready"
label = "operation"
topic = "/ready"
type = "std_msgs/msg/Bool"
require_publisher = true

[[page]]
id = "cell"
title = "Cell"

[[page.widget]]
id = "go"
kind = "publish"
label = "Go"
topic = "/go"
type = "std_msgs/msg/Empty"
message = {}

[[page.widget]]
id = "pressure"
kind = "readout"
label = "Pressure"
topic = "/pressure"
type = "std_msgs/msg/Float64"
"""


def topic(name: str, kind: str, *, sent: bool = True, latched: bool = False) -> SurveyedTopic:
    end = (
        TopicEndpoint(
            type=kind, qos=EndpointQos(reliable=True, transient_local=latched), nodes=("/n",)
        ),
    )
    return SurveyedTopic(
        name=name, key=name[1:], publishers=end if sent else (), subscribers=() if sent else end
    )


ITEMS: Final[list[tuple[Item, str]]] = [
    (topic("/temperature", "sensor_msgs/msg/Temperature"), "gauge figure readout trend alarm"),
    (topic("/air_pressure", "sensor_msgs/msg/FluidPressure"), "gauge figure readout trend alarm"),
    (topic("/boxes", "std_msgs/msg/UInt32"), "readout figure trend gauge alarm"),
    (topic("/speed", "std_msgs/msg/Float64"), "gauge figure readout trend alarm"),
    (topic("/operation_enabled", BOOL), "interlock indicator alarm"),
    (topic("/gripper_fault", BOOL), "indicator alarm interlock"),
    (topic("/mode", "std_msgs/msg/String"), "readout"),
    (topic("/camera", "sensor_msgs/msg/Image"), "camera"),
    (topic("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray"), "table"),
    (topic("/start", "std_msgs/msg/Empty", sent=False), "publish"),
    (topic("/cmd_vel", "geometry_msgs/msg/Twist", sent=False), "joystick"),
    (Server(name="/home", key="home", type="std_srvs/srv/Trigger"), "call"),
    (Server(name="/vacuum", key="vacuum", type="std_srvs/srv/SetBool"), "call call"),
    (Server(name="/count", key="count", type="example_interfaces/action/Fibonacci"), "action"),
    (Server(name="/navigate", key="navigate", type="nav2_msgs/action/NavigateToPose"), ""),
    (NodeParameter(node="/belt", name="speed_limit", type="double", value=60.0), "parameter"),
    (topic("/cloud", "sensor_msgs/msg/PointCloud2"), ""),
    (topic("/own", "my_msgs/msg/Own"), ""),
]


@pytest.mark.parametrize(("item", "kinds"), ITEMS, ids=lambda value: getattr(value, "name", None))
def test_an_item_has_the_kinds_that_fit(item: Item, kinds: str) -> None:
    known = suggestions_for(item, INTERFACES)
    assert [choice.kind for choice in known.choices] == kinds.split()
    assert bool(known.why_none) == (not kinds)
    for choice in known.choices:
        assert (
            all(render(choice.about, language) != "" for language in ("en", "ja", "de"))
            or not choice.about
        )


def written(tables: dict[str, Any]) -> str:
    """The tables as a file."""
    lines = [f"title = {value_text(tables['title'])}"]
    for name in ("interlock", "alarm"):
        for table in tables.get(name, ()):
            lines += [f"[[{name}]]", *(f"{key} = {value_text(value)}" for key, value in table.items())]
    for page in tables["page"]:
        lines += ["[[page]]", f"id = {value_text(page['id'])}", f"title = {value_text(page['title'])}"]
        for widget in page["widget"]:
            lines += ["[[page.widget]]"]
            lines += [f"{key} = {value_text(value)}" for key, value in widget.items()]
    return "\n".join(lines)


def applied(tables: dict[str, Any], edits: Any) -> dict[str, Any]:
    for edit in edits:
        *around, last = edit["path"]
        table: Any = tables
        for step in around:
            table = table.setdefault(step, []) if isinstance(table, dict) else table[step]
        if edit["op"] == "insert":
            table.insert(last, edit["value"])
        else:
            table[last] = edit["value"]
    return tables


CHOICES: Final = [choice for item, _ in ITEMS for choice in suggestions_for(item, INTERFACES).choices]


@pytest.mark.parametrize("choice", CHOICES, ids=lambda choice: f"{choice.name}-{choice.kind}")
def test_what_is_dropped_is_a_good_panel(choice: Suggestion, tmp_path: Path) -> None:
    tables = tomllib.loads(FILE)
    at = ("page", 0, "widget", 1)
    drop = drop_of(choice, tables, at)
    text = written(applied(tables, drop.edits))
    assert faults_of_text(text, tmp_path) == ()
    table: Any = tomllib.loads(text)
    for step in drop.select:
        table = table[step]
    assert table["id"] not in ("go", "pressure", "ready")
    assert drop.select == (
        at if choice.where == "widget" else (choice.where, len(tables[choice.where]) - 1)
    )


def test_an_interlock_that_is_dropped_on_a_command_locks_it() -> None:
    tables = tomllib.loads(FILE)
    new = suggestions_for(topic("/guard_closed", BOOL, latched=True), INTERFACES).choices
    interlock = next(choice for choice in new if choice.where == "interlock")
    go, shown = ("page", 0, "widget", 0), ("page", 0, "widget", 1)

    drop = drop_of(interlock, tables, go, go)
    assert drop.edits[1] == {"op": "set", "path": [*go, "interlock"], "value": "guard_closed"}
    assert drop.edits[0]["value"]["require_publisher"] is True
    applied(tables, drop.edits)

    again = drop_of(interlock, tables, go, go)
    assert (again.edits, again.select) == ([], ("interlock", 1))

    known = suggestions_for(topic("/ready", BOOL), INTERFACES).choices[0]
    (second,) = drop_of(known, tables, go, go).edits
    assert second["value"] == ["guard_closed", "ready"]
    assert drop_of(known, tables, shown, shown).edits == []


def test_an_alarm_begins_where_the_name_says_it_is_bad() -> None:
    sample = SimpleNamespace(fluid_pressure=570_000.0)
    low = suggestions_for(topic("/air_pressure", "sensor_msgs/msg/FluidPressure"), INTERFACES, sample)
    high = suggestions_for(topic("/temperature", "sensor_msgs/msg/Temperature"), INTERFACES)
    assert low.choices[-1].table["low"] == 1
    assert render(low.choices[-1].about, "en") == "below 1 bar"
    assert high.choices[-1].table["high"] == 90
    assert render(high.choices[0].about, "en") == "0 to 100 °C"


def test_ids_are_unique_beside_those_of_recipes_and_the_frame() -> None:
    tables = {
        "recipe": [{"id": "speed"}],
        "frame": {"widget": [{"id": "speed_2"}]},
        "page": [{"group": [{"widget": [{"id": "speed_3"}]}]}],
    }
    choice = suggestions_for(topic("/speed", "std_msgs/msg/Float64"), INTERFACES).choices[0]
    (edit,) = drop_of(choice, tables, ("page", 0, "widget", 0)).edits
    assert edit["value"]["id"] == "speed_4"
    assert list(edit["value"])[:3] == ["id", "kind", "label"]


@pytest.mark.parametrize(
    ("kind", "columns", "span"),
    [("gauge", 12, 6), ("gauge", 1, 1), ("trend", 12, 12), ("publish", 12, 4), ("gauge", None, None)],
)
def test_a_widget_takes_a_part_of_its_group(kind: str, columns: int | None, span: int | None) -> None:
    group = {"widget": [], **({"columns": columns} if columns else {})}
    tables = {"page": [{"group": [group]}]}
    at = ("page", 0, "group", 0, "widget", 0)
    (edit,) = drop_of(Suggestion("widget", kind, {"label": "A"}, "a"), tables, at).edits
    assert edit["value"].get("span") == span


def test_an_interlock_has_no_id_of_a_condition_and_is_not_one_that_waits_for_false() -> None:
    tables = tomllib.loads(FILE.replace("require_publisher", "equals = false\nrequire_publisher"))
    tables["condition"] = [{"id": "ready_2"}]
    choice = suggestions_for(topic("/ready", BOOL), INTERFACES).choices[0]
    drop = drop_of(choice, tables, ("page", 0, "widget", 0))
    assert drop.edits[0]["value"]["id"] == "ready_3"
    assert drop.select == ("interlock", 1)

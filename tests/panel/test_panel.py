"""The panel file: right ones are taken; each fault is named with its place and what would be right."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from app.cell.commands.goals import CANCEL, STATUS_ARRAY
from app.cell.link.rosout import LOG_TYPE
from app.panel import Panel, Publish, Readout, TextInput, check_panel, load_panel
from app.panel.checks.types import ROSOUT
from app.panel.widgets.kinds import KINDS
from app.panel.widgets.service_action import ACTION_SERVER_TYPES
from app.ros.messages import DISTROS
from app.system.errors import PanelError
from app.system.settings import PACKAGE
from app.system.texts import render
from tests.support.builders import FREE, GUARDED, HEARD, INTERLOCK, MESSAGE, TEXT, Table, small_panel

Load = Callable[[dict[str, Any]], Panel]

BUTTON = "page[0].widget[1]"
READOUT = "page[0].widget[3]"


def tables(**changes: Any) -> dict[str, Any]:
    """A good panel file: an input, a free and a guarded button, a readout."""
    page = {"id": "one", "title": "One", "widget": [MESSAGE, FREE, GUARDED, HEARD]}
    return {"title": "Cell", "interlock": [INTERLOCK], "page": [page], **changes}


def with_widget(place: int, **changes: Any) -> dict[str, Any]:
    made = tables()
    made["page"][0]["widget"][place] = {**made["page"][0]["widget"][place], **changes}
    return made


def without(table: Table, key: str) -> dict[str, Any]:
    return {name: value for name, value in table.items() if name != key}


def toml(value: Any) -> str:
    """A value as TOML writes it inline."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(k)} = {toml(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(toml, value)) + "]"
    return json.dumps(value)


@pytest.fixture
def load(tmp_path: Path) -> Load:
    """Writes tables to a file and loads it."""

    def loaded(content: dict[str, Any]) -> Panel:
        path = tmp_path / "cell.toml"
        path.write_text("".join(f"{name} = {toml(value)}\n" for name, value in content.items()))
        return load_panel(path)

    return loaded


def faults(load: Load, content: dict[str, Any]) -> dict[str, str]:
    """Place → message of every fault."""
    with pytest.raises(PanelError) as caught:
        load(content)
    assert not caught.value.unreadable
    assert len({fault.place for fault in caught.value.faults}) == len(caught.value.faults)
    return {fault.place: fault.message for fault in caught.value.faults}


def test_the_shipped_panel_is_good_and_a_demo() -> None:
    panel = load_panel(PACKAGE / "panel.toml")
    assert panel.mode == "demo"
    assert panel.demo_story == "palletizing"
    cell, reference = panel.pages[:2]
    assert [w.id for w in panel.frame.widgets] == ["stop"]
    assert {"boxes", "pallet", "start", "pause", "reset"} <= {w.id for w in cell.widgets}
    assert [w.id for w in reference.widgets] == [
        "enabled", "last_heard", "message", "operation", "operation1", "operation2",
    ]  # fmt: skip
    placed = {w.kind for w in panel.widgets()} - {"state"}  # of the header
    # It has no picture and drives nowhere; its alarms have the frame's line and a page of their own.
    assert placed == set(KINDS) - {"image", "map", "place", "tour", "alarm_line", "alarm_list"}
    assert panel.interlocks[0].id == "operation"
    assert [w.id for w in panel.commands if w.interlocks == ("operation",)][:2] == [
        "operation1", "operation2",
    ]  # fmt: skip


def test_a_file_becomes_descriptions(load: Load) -> None:
    panel = load(tables())
    kinds = [type(widget) for widget in panel.widgets()]
    assert kinds == [TextInput, Publish, Publish, Readout]
    guarded = list(panel.widgets())[2]
    assert isinstance(guarded, Publish)
    assert (guarded.topic, guarded.type, guarded.interlocks) == ("/guarded", TEXT, ("operation",))
    assert guarded.message == {"data": "{message}"}


def test_a_file_that_does_not_say_means_a_live_robot(load: Load) -> None:
    assert load(tables()).mode == "live"


def test_interlock_defaults_to_the_data_of_a_bool(load: Load) -> None:
    (interlock,) = load(tables()).interlocks
    assert (interlock.type, interlock.field) == ("std_msgs/msg/Bool", "data")
    assert (interlock.max_age_s, interlock.require_publisher) == (None, False)


@pytest.mark.parametrize(("label", "name"), [(None, "operation"), ("The cell", "The cell")])
def test_an_interlock_is_called_by_its_label(label: str | None, name: str) -> None:
    assert small_panel({"label": label}).interlocks[0].name == name


def test_the_operators_log_is_kept_and_required_unless_the_file_says_otherwise(load: Load) -> None:
    rules = load(tables()).log
    assert (rules.enabled, rules.required, rules.days, rules.size_mb) == (True, True, 365, 512)
    assert load(tables(log={"required": False, "days": 30})).log.required is False


def test_loaded_panel_is_immutable(load: Load) -> None:
    panel = load(tables())
    with pytest.raises(ValidationError, match="frozen"):
        panel.title = "Other"


@pytest.mark.parametrize(
    ("written", "namespace"),
    [("", ""), ("/", ""), ("robot1", "/robot1"), ("/robot1", "/robot1"), ("/a/b/", "/a/b")],
)
def test_a_namespace_is_written_one_way(load: Load, written: str, namespace: str) -> None:
    assert load(tables(namespace=written)).namespace == namespace


def test_panel_lists_its_subscriptions_and_publications(load: Load) -> None:
    panel = load(tables())
    assert panel.subscriptions() == {"/operation_enabled": "std_msgs/msg/Bool", "/heard": TEXT}
    assert panel.publications() == {"/free": TEXT, "/guarded": TEXT}


def test_pages_and_interlocks_are_found_by_id(load: Load) -> None:
    panel = load(tables())
    assert panel.page("one") is panel.pages[0]
    assert panel.page("two") is None
    assert panel.interlock("operation") is panel.interlocks[0]
    assert panel.interlock("other") is None


def test_the_revision_changes_with_the_file(load: Load) -> None:
    loaded_panel, same, other = load(tables()), load(tables()), load(tables(title="Other"))
    assert loaded_panel.revision == same.revision
    assert loaded_panel.revision != other.revision


def test_a_default_may_be_as_long_as_its_input(load: Load) -> None:
    (text, *_) = load(with_widget(0, default="12345678")).widgets()
    assert isinstance(text, TextInput)
    assert len(text.default) == text.max_length


def test_an_interlock_and_a_widget_may_have_one_id(load: Load) -> None:
    assert load(with_widget(1, id="operation")).interlock("operation")


@pytest.mark.parametrize(
    ("content", "place", "message"),
    [
        (without(tables(), "title"), "title", "is missing"),
        (without(tables(), "page"), "page", "is missing"),
        (tables(page=[]), "page", "is missing: a panel has one page at least"),
        (tables(title=3), "title", "must be text, not 3"),
        (tables(title=""), "title", "must not be empty"),
        (tables(titel="x"), "titel", 'unknown key; did you mean "title"?'),
        (tables(interlocks=[]), "interlocks", 'unknown key; did you mean "interlock"?'),
        (tables(zzz=1), "zzz", "unknown key; known here: title, mode, language"),
        (tables(revision="x"), "revision", "unknown key"),
        (tables(mode="DEMO"), "mode", 'must be "demo" or "live", not "DEMO": did you mean "demo"?'),
        (tables(language="tlh"), "language", 'not "tlh"'),
        (tables(distro="foxy"), "distro", '"kilted", "lyrical" or "rolling", not "foxy"'),
        (
            tables(namespace="a b"),
            "namespace",
            '"a b" is not a ROS 2 namespace: it must be like /robot1',
        ),
        (tables(namespace="/a//b"), "namespace", "is not a ROS 2 namespace"),
        (tables(log={"days": 0}), "log.days", "must be more than 0, not 0"),
        (tables(log={"size_mb": 1}), "log.size_mb", "must be 8 or more, not 1"),
        (tables(log={"required": "no"}), "log.required", 'must be true or false, not "no"'),
        (tables(log={"requierd": False}), "log.requierd", 'did you mean "required"?'),
        (tables(display_hz=0.5), "display_hz", "must be 1 or more, not 0.5"),
        (tables(display_hz=61), "display_hz", "must be 60 or less, not 61"),
        (tables(display_hz="fast"), "display_hz", 'must be a number, not "fast"'),
        (tables(mm_per_px=0), "mm_per_px", "must be more than 0.02, not 0"),
        (tables(mm_per_px="0.2"), "mm_per_px", 'must be a number, not "0.2"'),
        (
            tables(interlock=[INTERLOCK, {**INTERLOCK, "id": "Op"}]),
            "interlock[1].id",
            '"Op" is not an id: a-z, 0-9',
        ),
        (tables(interlock=[INTERLOCK, INTERLOCK]), "interlock[1].id", "already the id of interlock[0]"),
        (tables(interlock=[INTERLOCK, {"id": "x"}]), "interlock[1].topic", "is missing"),
        (
            tables(interlock=[{**INTERLOCK, "topic": "enabled"}]),
            "interlock[0].topic",
            '"enabled" is not an absolute ROS 2 topic name: it starts with "/"',
        ),
        (
            tables(interlock=[{**INTERLOCK, "type": "std_msgs/msg/Boll"}]),
            "interlock[0].type",
            "is not an interface of ROS 2 jazzy; did you mean std_msgs/msg/Bool",
        ),
        (
            tables(interlock=[{**INTERLOCK, "type": TEXT}]),
            "interlock[0].field",
            '"data" is string: an interlock needs a bool',
        ),
        (
            tables(interlock=[{**INTERLOCK, "field": "value"}]),
            "interlock[0].field",
            'there is no "value"',
        ),
        (
            tables(interlock=[{**INTERLOCK, "max_age_s": 0}]),
            "interlock[0].max_age_s",
            "must be more than 0, not 0",
        ),
        (
            tables(interlock=[{**INTERLOCK, "qos": {"reliability": "best_effort"}}]),
            "interlock[0].max_age_s",
            "is missing: of a best-effort topic any message may be lost, the one that forbids too",
        ),
        (
            tables(interlock=[{**INTERLOCK, "require_publisher": 1}]),
            "interlock[0].require_publisher",
            "must be true or false, not 1",
        ),
        (
            tables(interlock=[{**INTERLOCK, "maxage": 1}]),
            "interlock[0].maxage",
            'did you mean "max_age_s"?',
        ),
        (tables(page=[{"id": "one"}]), "page[0].title", "is missing"),
        (
            tables(page=[{"id": "one", "title": "One"}, {"id": "one", "title": "Two"}]),
            "page[1].id",
            '"one" is already the id of page[0]',
        ),
        (
            with_widget(1, kind="knob"),
            f"{BUTTON}.kind",
            'unknown kind "knob"; one of text, number, slider, select, toggle, publish',
        ),
        (
            tables(page=[{"id": "one", "title": "One", "widget": [without(FREE, "kind")]}]),
            "page[0].widget[0]",
            '"kind" is missing; one of text, number, slider, select, toggle, publish',
        ),
        (with_widget(1, shade="red"), f"{BUTTON}.shade", "known here: id, robot, label, show_label"),
        (with_widget(1, lable="x"), f"{BUTTON}.lable", 'did you mean "label"?'),
        (with_widget(1, max_length=3), f"{BUTTON}.max_length", "unknown key"),
        (with_widget(1, label=""), f"{BUTTON}.label", "must not be empty"),
        (
            with_widget(1, id="1st"),
            f"{BUTTON}.id",
            '"1st" is not an id: a-z, 0-9 and "_", a letter first',
        ),
        (with_widget(1, id="message"), f"{BUTTON}.id", "is already the id of page[0].widget[0]"),
        (with_widget(1, span=13), f"{BUTTON}.span", "must be 12 or less, not 13"),
        (with_widget(1, span=True), f"{BUTTON}.span", "must be a whole number, not true"),
        (with_widget(1, topic="/a b"), f"{BUTTON}.topic", "is not an absolute ROS 2 topic name"),
        (with_widget(1, topic="/a/"), f"{BUTTON}.topic", "is not an absolute ROS 2 topic name"),
        (with_widget(1, topic="/a__b"), f"{BUTTON}.topic", "is not an absolute ROS 2 topic name"),
        (with_widget(1, topic="/**"), f"{BUTTON}.topic", "is not an absolute ROS 2 topic name"),
        (
            with_widget(1, topic="/" + "t" * 255),
            f"{BUTTON}.topic",
            "must be 255 characters at most; it has 256",
        ),
        (
            with_widget(1, type="std_msgs/String"),
            f"{BUTTON}.type",
            '"std_msgs/String" is not a ROS 2 message type: it must be like std_msgs/msg/Bool',
        ),
        (
            with_widget(1, type="std_msgs/msg/Strng"),
            f"{BUTTON}.type",
            "is not an interface of ROS 2 jazzy; did you mean std_msgs/msg/String",
        ),
        (
            with_widget(1, interlock="other"),
            f"{BUTTON}.interlock",
            'no interlock "other"; there is operation',
        ),
        (with_widget(1, interlock="Other"), f"{BUTTON}.interlock", '"Other" is not an id'),
        (with_widget(1, message="hello"), f"{BUTTON}.message", "must be a table, like { field ="),
        (
            with_widget(1, message={"data": "", "dat": 1}),
            f"{BUTTON}.message.dat",
            "unknown field; std_msgs/msg/String has data",
        ),
        (with_widget(1, message={"data": 5}), f"{BUTTON}.message.data", "must be text (string), not 5"),
        (
            with_widget(1, message={"data": "{massage}"}),
            f"{BUTTON}.message.data",
            'no input "massage"; did you mean "message"?',
        ),
        (
            with_widget(1, message={"data": "{message"}),
            f"{BUTTON}.message.data",
            "write {{ and }} for braces",
        ),
        (with_widget(1, message={"data": "{free}"}), f"{BUTTON}.message.data", 'no input "free"'),
        (
            with_widget(1, type="std_msgs/msg/Int8", message={"data": 200}),
            f"{BUTTON}.message.data",
            "200 is out of range: int8 goes from -128 to 127",
        ),
        (
            with_widget(1, type="std_msgs/msg/Int8", message={"data": "{message}"}),
            f"{BUTTON}.message.data",
            'input "message" gives text; the field is int8',
        ),
        (
            with_widget(1, type="geometry_msgs/msg/Polygon", message={"points": [{"x": 1.5, "w": 0}]}),
            f"{BUTTON}.message.points[0].w",
            "unknown field; geometry_msgs/msg/Point32 has x, y, z",
        ),
        (with_widget(0, max_length=0), "page[0].widget[0].max_length", "must be 1 or more, not 0"),
        (
            with_widget(0, default="123456789"),
            "page[0].widget[0].default",
            "longer than max_length (8)",
        ),
        (
            with_widget(3, field="value"),
            f"{READOUT}.field",
            'there is no "value" (in "value"): std_msgs/msg/String has data',
        ),
        (with_widget(3, field="data.x"), f"{READOUT}.field", "string has no fields of its own"),
        (with_widget(3, type="std_msgs/msg/Strng"), f"{READOUT}.type", "did you mean"),
        (with_widget(3, max_age_s=-1), f"{READOUT}.max_age_s", "must be more than 0, not -1"),
        (
            with_widget(3, topic="/free", type="std_msgs/msg/Bool"),
            f"{READOUT}.type",
            "/free is std_msgs/msg/Bool here but std_msgs/msg/String above",
        ),
        (
            with_widget(3, topic="/operation_enabled"),
            f"{READOUT}.type",
            "/operation_enabled is std_msgs/msg/String here but std_msgs/msg/Bool above",
        ),
    ],
)
def test_a_fault_is_named_with_its_place(
    load: Load, content: dict[str, Any], place: str, message: str
) -> None:
    reported = faults(load, content)
    assert list(reported) == [place]
    assert message in reported[place]


PARAMETER = {
    "id": "p",
    "kind": "parameter",
    "label": "P",
    "node": "/arm",
    "parameter": "speed",
    "type": "double",
}
CALL = {
    "id": "call",
    "kind": "call",
    "label": "Call",
    "service": "/add",
    "type": "example_interfaces/srv/AddTwoInts",
    "request": {"a": 1, "b": 2},
}
ACTION = {
    "id": "act",
    "kind": "action",
    "label": "Act",
    "action": "/count",
    "type": "example_interfaces/action/Fibonacci",
    "goal": {"order": 3},
}
NUMBER = {"id": "n", "kind": "number", "label": "N", "min": 0, "max": 1}
LAMP = {**HEARD, "kind": "indicator", "states": [{"value": "a", "text": "A", "shape": "circle"}]}


@pytest.mark.parametrize(
    ("widget", "place", "message"),
    [
        (without(NUMBER, "max"), "max", "is missing"),
        ({**NUMBER, "min": "0"}, "min", 'must be a number, not "0"'),
        ({**NUMBER, "max": 2**53 + 2}, "max", "must be 9007199254740992 or less, not 9007199254740994"),
        ({**NUMBER, "step": 0}, "step", "must be more than 0, not 0"),
        ({**NUMBER, "kind": "slider", "units": "m"}, "units", 'did you mean "unit"?'),
        ({"id": "s", "kind": "select", "label": "S"}, "options", "is missing"),
        (
            {"id": "s", "kind": "select", "label": "S", "options": []},
            "options",
            "is empty: it must have one at least",
        ),
        (
            {"id": "s", "kind": "select", "label": "S", "options": [{"value": 1}]},
            "options[0].label",
            "is missing",
        ),
        (
            {"id": "t", "kind": "toggle", "label": "T", "default": 1},
            "default",
            "must be true or false, not 1",
        ),
        (
            {**HEARD, "format": "{0.__class__}"},
            "format",
            '"{0.__class__}" is not a format: it must be like ".1f"',
        ),
        ({**HEARD, "constants": "status"}, "constants", "it must be like STATUS_"),
        ({**HEARD, "qos": {"depth": 0}}, "qos.depth", "must be 1 or more, not 0"),
        (
            {**HEARD, "qos": {"reliability": "best"}},
            "qos.reliability",
            '"reliable" or "best_effort", not',
        ),
        ({**HEARD, "qos": {"reliable": True}}, "qos.reliable", 'did you mean "reliability"?'),
        ({**LAMP, "states": 5}, "states", "must be a list of tables, like [{ value = 0"),
        (
            {**LAMP, "states": [{"value": 1.5, "text": "A", "shape": "circle"}]},
            "states[0].value",
            "must be a whole number, true or false, or text, not 1.5",
        ),
        (
            {**LAMP, "states": [{"value": "a", "text": "A", "shape": "star"}]},
            "states[0].shape",
            'must be "circle", "square", "triangle", "diamond", "cross", "bar", "play" or "pause", not'
            ' "star"',
        ),
        (
            {**LAMP, "states": [{"value": "a", "text": "A", "shape": "bar", "colour": "green"}]},
            "states[0].colour",
            '"blue", "yellow" or "red", not "green"',
        ),
    ],
)
def test_a_fault_of_an_input_or_a_display_is_named_with_its_place(
    load: Load, widget: dict[str, Any], place: str, message: str
) -> None:
    page = {"id": "one", "title": "One", "widget": [widget]}
    reported = faults(load, tables(page=[page]))
    assert list(reported) == [f"page[0].widget[0].{place}"]
    assert message in reported[f"page[0].widget[0].{place}"]


@pytest.mark.parametrize(
    ("content", "place", "where"),
    [
        (
            without(tables(interlock=[{**INTERLOCK, "title": "Cell"}]), "title"),
            "interlock[0].title",
            "the file itself: write it above the first table",
        ),
        (
            tables(interlock=[{**INTERLOCK, "namespace": "/r1"}]),
            "interlock[0].namespace",
            "the file itself: write it above the first table",
        ),
        (
            tables(page=[{"id": "one", "widget": [{**HEARD, "title": "One"}]}]),
            "page[0].widget[0].title",
            "page[0]: write it above its [[page.widget]]",
        ),
    ],
)
def test_a_key_that_stands_too_far_below_is_one_fault(
    load: Load, content: dict[str, Any], place: str, where: str
) -> None:
    assert faults(load, content) == {place: f"unknown key; it belongs to {where}"}


def test_keys_that_are_unknown_in_a_widget_are_reported_together(load: Load) -> None:
    text = {**MESSAGE, "constants": "A", "order": 2}
    page = {"id": "one", "title": "One", "widget": [text]}
    assert faults(load, tables(page=[page])) == {
        "page[0].widget[0].constants": (
            'unknown key, as "order"; known here: '
            "id, robot, label, show_label, span, rows, grow, kind, max_length, default, scan"
        )
    }


def test_faults_of_one_cause_are_one_fault_with_all_places(load: Load) -> None:
    buttons = [{**GUARDED, "id": f"b{n}", "topic": f"/b{n}", "interlock": "x"} for n in range(6)]
    page = {"id": "one", "title": "One", "widget": [MESSAGE, *buttons]}
    assert faults(load, tables(page=[page])) == {
        "page[0].widget[1].interlock": (
            'no interlock "x"; there is operation (also at page[0].widget[2].interlock, '
            "page[0].widget[3].interlock, page[0].widget[4].interlock and 2 more)"
        )
    }


def test_a_package_that_is_nowhere_is_reported_once(load: Load) -> None:
    lamps = [{**LAMP, "id": name.lower(), "type": f"my_robot/msg/{name}"} for name in ("Arm", "Leg")]
    page = {"id": "one", "title": "One", "widget": lamps}
    ((place, why),) = faults(load, tables(page=[page])).items()
    assert place == "page[0].widget[0].type"
    assert "there is no package my_robot: its folder must be among the panel's `interfaces`" in why
    assert why.endswith("(also at page[0].widget[1].type)")


def test_faults_are_reported_in_the_order_of_the_file(load: Load, tmp_path: Path) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(
        '[[page]]\nid = "A"\ntitle = "One"\n[[interlock]]\nid = "a"\n'
        '[[page.widget]]\nid = "b"\nkind = "text"\nlabel = ""\n'
    )
    with pytest.raises(PanelError) as caught:
        load_panel(path)
    assert [(fault.place, fault.line) for fault in caught.value.faults] == [
        ("title", 0),
        ("page[0].id", 2),
        ("interlock[0].topic", 4),
        ("page[0].widget[0].label", 9),
    ]


def test_faulty_input_causes_no_fault_in_its_messages(load: Load) -> None:
    used = {**FREE, "type": "std_msgs/msg/Int8", "message": {"data": "{n}"}}
    page = {"id": "one", "title": "One", "widget": [without(NUMBER, "max"), used]}
    assert list(faults(load, tables(page=[page]))) == ["page[0].widget[0].max"]


def test_input_of_another_page_is_unknown_here(load: Load) -> None:
    pages = [
        {"id": "one", "title": "One", "widget": [MESSAGE]},
        {"id": "two", "title": "Two", "widget": [FREE]},
    ]
    assert faults(load, tables(page=pages)) == {
        "page[1].widget[0].message.data": (
            'no input "message" on this page: an input is read from the page it is on'
        )
    }


def test_a_widget_id_is_unique_over_all_pages(load: Load) -> None:
    pages = [{"id": name, "title": name, "widget": [HEARD]} for name in ("one", "two")]
    assert faults(load, tables(page=pages)) == {
        "page[1].widget[0].id": '"heard" is already the id of page[0].widget[0], line 3'
    }


def test_all_faults_of_the_shape_are_reported_at_once(load: Load) -> None:
    content = with_widget(1, topic="free", span=0)
    del content["title"]
    assert list(faults(load, content)) == ["title", f"{BUTTON}.span", f"{BUTTON}.topic"]


def test_all_faults_of_names_and_messages_are_reported_at_once(load: Load) -> None:
    content = with_widget(1, interlock="other", message={"data": 5})
    content["interlock"] = [{**INTERLOCK, "field": "value"}, {**INTERLOCK, "id": "b", "type": TEXT}]
    assert sorted(faults(load, content)) == [
        "interlock[0].field",
        "interlock[1].field",
        f"{BUTTON}.interlock",
        f"{BUTTON}.message.data",
    ]


def test_a_message_may_be_of_any_depth(load: Load) -> None:
    panel = load(
        with_widget(
            1,
            type="geometry_msgs/msg/PolygonStamped",
            message={
                "header": {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": "{message}"},
                "polygon": {"points": [{"x": 1, "y": -2.5, "z": 0}]},
            },
        )
    )
    assert panel.publications()["/free"] == "geometry_msgs/msg/PolygonStamped"


@pytest.mark.parametrize(
    ("widget", "type_name"),
    [
        (FREE, TEXT),
        (FREE, "geometry_msgs/msg/PoseStamped"),
        ({**GUARDED, "kind": "hold", "release": {}}, "geometry_msgs/msg/Twist"),
        (CALL, "example_interfaces/srv/AddTwoInts"),
        (ACTION, "example_interfaces/action/Fibonacci"),
    ],
)
def test_a_message_may_leave_out_all_of_its_fields(load: Load, widget: Table, type_name: str) -> None:
    (part,) = {"message", "request", "goal"} & widget.keys()
    page = {"id": "one", "title": "One", "widget": [{**widget, "type": type_name, part: {}}]}
    assert load(tables(page=[page]))


def test_a_message_without_fields_can_be_sent(load: Load) -> None:
    assert load(with_widget(1, type="std_msgs/msg/Empty", message={}))


@pytest.mark.parametrize("distro", DISTROS)
def test_types_are_those_of_the_robots_distribution(load: Load, distro: str) -> None:
    assert load(tables(distro=distro)).distro == distro


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (b"title = ", 'line 1: "title" has no value'),
        (
            b"[[page]\n",
            r"the brackets of a header are the same on both sides: write \[\[page\]\]",
        ),
        (b"title = 'a'\ntitle = 'b'\n", 'line 2: "title" is above already, in line 1'),
        (b"[log]\na = 1\n[log]\n", r"line 3: \[log\] is above already, in line 1"),
        (
            b"[[page]]\nwidget = []\n[[page.widget]]\n",
            "line 3: nothing can be added to .*: page.widget",
        ),
        (b"\xff\xfe", "line 1: byte 0xff is not UTF-8: save the file as UTF-8"),
        (b"a = 1\nb = '\xfc'\n", "line 2: byte 0xfc is not UTF-8"),
    ],
)
def test_invalid_toml_file_is_unreadable(tmp_path: Path, data: bytes, reason: str) -> None:
    path = tmp_path / "cell.toml"
    path.write_bytes(data)
    with pytest.raises(PanelError, match=reason) as caught:
        load_panel(path)
    assert caught.value.unreadable
    assert [fault.place for fault in caught.value.faults] == [""]


def test_unknown_field_is_not_also_a_fault_of_its_input(load: Load) -> None:
    reported = faults(load, with_widget(1, message={"date": "{message}"}))
    assert reported == {f"{BUTTON}.message.date": "unknown field; std_msgs/msg/String has data"}


def test_a_mark_of_the_byte_order_is_no_fault(tmp_path: Path) -> None:
    path = tmp_path / "cell.toml"
    path.write_text((PACKAGE / "panel.toml").read_text(), encoding="utf-8-sig")
    assert render(load_panel(path).title) == "Robot cell 1"


@pytest.mark.parametrize(("name", "reason"), [("none.toml", "No such file"), (".", "Is a directory")])
def test_a_file_that_is_not_there_is_unreadable(tmp_path: Path, name: str, reason: str) -> None:
    with pytest.raises(PanelError, match=reason) as caught:
        load_panel(tmp_path / name)
    assert caught.value.unreadable
    assert str(tmp_path / name) in str(caught.value)


def test_a_fault_of_shape_hides_no_fault_of_meaning(load: Load) -> None:
    content = with_widget(1, message={"dat": "x"}) | {"titel": "x"}
    content["page"][0]["widget"][3] = {**HEARD, "kind": "redaout"}
    content["interlock"] = [{**INTERLOCK, "max_age": 1}]
    assert set(faults(load, content)) == {
        "titel",
        "interlock[0].max_age",
        "page[0].widget[3].kind",
        "page[0].widget[1].message.dat",
    }


@pytest.mark.parametrize(
    ("content", "place"),
    [
        (tables(page=[{"id": "one", "title": "One", "text": "x"}]), "page[0].text"),
        (tables(interlock=[{**INTERLOCK, "publish": 1}]), "interlock[0].publish"),
        (tables(revision="x"), "revision"),
        (tables(page={"id": "one", "title": "One"}), "page"),
    ],
)
def test_keys_named_like_something_else_keep_their_place(
    load: Load, content: dict[str, Any], place: str
) -> None:
    assert list(faults(load, content)) == [place]


@pytest.mark.parametrize(
    ("content", "reason"),
    [("[" * 5000, "too many brackets in brackets"), ("9" * 5000, "a number has too many digits")],
)
def test_file_that_exhausts_the_parser_is_unreadable(tmp_path: Path, content: str, reason: str) -> None:
    path = tmp_path / "panel.toml"
    path.write_text(f"a = {content}")
    with pytest.raises(PanelError, match=reason) as error:
        load_panel(path)
    assert error.value.unreadable


def interface(tmp_path: Path, text: str = "bool[2] closed\nfloat32 kelvin\n") -> None:
    folder = tmp_path / "msgs/cell_msgs/msg"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "Doors.msg").write_text(text)


def with_doors(field: str) -> dict[str, Any]:
    made = with_widget(3, type="cell_msgs/msg/Doors", field=field)
    return {"interfaces": ["msgs"], **made}


def test_a_panel_may_bring_interfaces_beside_it(load: Load, tmp_path: Path) -> None:
    interface(tmp_path)
    panel = load(with_doors("closed[1]"))
    assert panel.interfaces == (tmp_path / "msgs",)
    assert faults(load, with_doors("closed[2]")) == {
        f"{READOUT}.field": 'there is no [2] (in "closed[2]"): bool[2] ends with [1]'
    }


def test_an_interface_file_with_a_fault_is_named(load: Load, tmp_path: Path) -> None:
    interface(tmp_path, "bool closed\nfloat31 kelvin\n")
    reported = faults(load, with_doors("closed"))
    assert list(reported) == [f"{READOUT}.type"]
    assert reported[f"{READOUT}.type"].startswith('"cell_msgs/msg/Doors" can\'t be used: ')
    assert "msgs/cell_msgs/msg/Doors.msg:2: " in reported[f"{READOUT}.type"]


def test_an_interface_file_that_the_panel_does_not_need_may_have_a_fault(
    load: Load, tmp_path: Path
) -> None:
    interface(tmp_path)
    for name in ("Wear", "Tool"):
        (tmp_path / f"msgs/cell_msgs/msg/{name}.msg").write_text("float31 kelvin\n")
    load(with_doors("closed[0]"))
    notes = map(str, check_panel(tmp_path / "cell.toml").notes)
    (note,) = (line for line in notes if line.startswith("note: interfaces"))
    assert note.startswith(
        "note: interfaces[0], line 1: cell_msgs/msg/Tool can't be used, and this panel "
    )
    assert "msgs/cell_msgs/msg/Tool.msg:1: " in note
    assert note.endswith("; 1 more can't be used either")


@pytest.mark.parametrize(
    ("widgets", "name"),
    [
        ([], ROSOUT),
        ([ACTION], "action_msgs/msg/GoalStatusArray"),
        ([PARAMETER], "rcl_interfaces/msg/ParameterEvent"),
    ],
)
def test_types_that_the_server_needs_must_be_usable(
    load: Load, tmp_path: Path, widgets: list[Table], name: str
) -> None:
    interface(tmp_path)
    path = tmp_path / f"msgs/{name}.msg"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("float31 kelvin\n")
    page = {"id": "one", "title": "One", "widget": widgets}
    reported = faults(load, {"interfaces": ["msgs"], **tables(page=[page])})
    assert list(reported) == ["interfaces[0]"]
    assert reported["interfaces[0]"].startswith(f'the panel needs this type: "{name}" can\'t')


def test_server_types_are_the_types_in_use() -> None:
    assert ROSOUT == LOG_TYPE
    assert (STATUS_ARRAY, f"{CANCEL}_Request") == ACTION_SERVER_TYPES


def test_the_folder_with_the_fault_is_named(load: Load, tmp_path: Path) -> None:
    interface(tmp_path)
    empty = tmp_path / "empty"
    empty.mkdir()
    reported = faults(load, {**with_doors("closed"), "interfaces": ["msgs", "empty"]})
    assert reported == {
        "interfaces[1]": f"{empty} has no interfaces: "
        "they must be in <package>/msg/*.msg, srv/*.srv, action/*.action"
    }


@pytest.mark.parametrize(
    ("folders", "place", "why"),
    [
        (["none"], "interfaces[0]", "is not a folder: it must be a ROS package or have some in it"),
        ([5], "interfaces[0]", "must be the path of a folder, not 5"),
        ([""], "interfaces[0]", 'must be the path of a folder, not ""'),
        ("msgs", "interfaces", 'must be a list of folders: write ["folder"]'),
    ],
)
def test_interfaces_are_folders(load: Load, folders: Any, place: str, why: str) -> None:
    reported = faults(load, {"interfaces": folders, **tables()})
    assert list(reported) == [place]
    assert why in reported[place]


@pytest.mark.parametrize(
    ("widget", "key", "message"),
    [
        ({**CALL, "type": "example_interfaces/srv/AddTwo"}, "type", "did you mean"),
        ({**CALL, "type": "std_msgs/msg/Bool"}, "type", "is not a ROS 2 service type"),
        ({**CALL, "request": {"a": 1, "c": 2}}, "request.c", "unknown field; "),
        ({**CALL, "request": {"a": 1, "b": 2.5}}, "request.b", "must be a whole number (int64)"),
        ({**CALL, "answer": "{total}"}, "answer", 'there is no "total"'),
        ({**CALL, "success": "sum"}, "success", '"sum" is int64: it must be bool'),
        ({**CALL, "interlock": "nothing"}, "interlock", 'no interlock "nothing"'),
        ({**CALL, "timeout_s": 0}, "timeout_s", "must be more than 0, not 0"),
        ({**ACTION, "type": "example_interfaces/action/Fibo"}, "type", "did you mean"),
        ({**ACTION, "goal": {"order": "{message}"}}, "goal.order", "gives text; the field is int32"),
        ({**ACTION, "progress": "sequence"}, "progress", "is int32[]: it must be a number"),
        ({**ACTION, "feedback": "{done}"}, "feedback", 'there is no "done"'),
        ({**ACTION, "result": "{sequenze}"}, "result", 'there is no "sequenze"'),
    ],
)
def test_a_fault_of_a_call_or_an_action_is_named(
    load: Load, widget: dict[str, Any], key: str, message: str
) -> None:
    page = {"id": "one", "title": "One", "widget": [MESSAGE, widget]}
    reported = faults(load, tables(page=[page]))
    assert list(reported) == [f"page[0].widget[1].{key}"]
    assert message in reported[f"page[0].widget[1].{key}"]


def test_a_call_and_an_action_are_taken(load: Load) -> None:
    page = {"id": "one", "title": "One", "widget": [MESSAGE, CALL, ACTION]}
    panel = load(tables(page=[page]))
    assert panel.actions() == {"/count": "example_interfaces/action/Fibonacci"}

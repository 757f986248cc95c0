"""Inputs, displays and QoS in a panel file: typed templates and the faults of a wrong one."""

from collections.abc import Mapping
from typing import Any, Final

import pytest
from pydantic import ValidationError

from app.panel.base import TopicQos
from app.panel.checks.panel import find_faults
from app.panel.times import DURATION, TIME
from app.panel.widgets.parameter import DESCRIBE, EVENT_TYPE, GET, SET
from app.ros.messages import DISTROS, load_interfaces
from app.system.errors import Fault
from tests.support.builders import ENABLED, FREE, GUARDED, HEARD, INTERFACES, MESSAGE, TEXT, panel_of

TWIST = "geometry_msgs/msg/Twist"
ZERO = {"x": 0, "y": 0, "z": 0}
NUMBER: Mapping[str, Any] = {"id": "n", "kind": "number", "label": "N", "min": 0, "max": 10}
SELECT: Mapping[str, Any] = {
    "id": "s", "kind": "select", "label": "S",
    "options": [{"value": 1, "label": "One"}, {"value": 2, "label": "Two"}],
}  # fmt: skip
TOGGLE: Mapping[str, Any] = {"id": "t", "kind": "toggle", "label": "T"}
STATES: list[Any] = [{"value": 0, "text": "Idle", "shape": "circle"}]
LAMP: Mapping[str, Any] = {
    **HEARD, "kind": "indicator", "type": "std_msgs/msg/UInt8", "states": STATES,
}  # fmt: skip
PARAMETER: Mapping[str, Any] = {
    "id": "p", "kind": "parameter", "label": "P", "node": "/arm", "parameter": "speed",
    "type": "double",
}  # fmt: skip
IMAGE_FORMATS = "sensor_msgs/msg/PointField"


def faults(*widgets: Mapping[str, Any], **more: Any) -> list[str]:
    return [str(fault) for fault in find_faults(panel_of(*widgets, **more), INTERFACES)]


def sent(type_name: str, message: Any) -> dict[str, Any]:
    return {**FREE, "type": type_name, "message": message}


def std(kind: str, placeholder: str) -> dict[str, Any]:
    return sent(f"std_msgs/msg/{kind}", {"data": placeholder})


@pytest.mark.parametrize(
    "widgets",
    [
        (NUMBER, std("Float64", "{n}")),
        ({**NUMBER, "step": 0.5}, std("Float32", "{n}")),
        ({**NUMBER, "min": -1.0, "max": 1.0, "default": 0.123}, std("Float64", "{n}")),
        (NUMBER, std("UInt8", "{n}")),
        ({**NUMBER, "min": -128, "max": 127}, std("Int8", "{n}")),
        ({**NUMBER, "kind": "slider", "default": 5}, std("Int64", "{n}")),
        (NUMBER, std("String", "speed {n}")),
        (NUMBER, sent(TWIST, {"linear": {**ZERO, "x": "{n}"}, "angular": ZERO})),
        (SELECT, std("UInt8", "{s}")),
        ({**SELECT, "default": 2}, std("Float64", "{s}")),
        (TOGGLE, std("Bool", "{t}")),
        (TOGGLE, std("String", "it is {t}")),
        (
            {**SELECT, "options": [{"value": {"x": 1, "y": 2, "z": 0}, "label": "Home"}]},
            sent("geometry_msgs/msg/Point", {"x": 1, "y": 2, "z": 0}),
            {**sent(TWIST, {"linear": "{s}", "angular": ZERO}), "id": "twist", "topic": "/twist"},
        ),
    ],
)
def test_an_input_fits_a_field_of_its_type(widgets: tuple[Mapping[str, Any], ...]) -> None:
    assert faults(*widgets) == []


@pytest.mark.parametrize(
    ("widgets", "fault"),
    [
        ((MESSAGE, std("Float64", "{message}")), 'input "message" gives text; the field is float64'),
        ((MESSAGE, std("Bool", "{message}")), 'input "message" gives text; the field is bool'),
        ((TOGGLE, std("Float64", "{t}")), 'input "t" gives true or false; the field is float64'),
        ((TOGGLE, std("String", "{t}")), 'input "t" gives true or false; the field is string'),
        ((NUMBER, std("Bool", "{n}")), 'input "n" gives whole numbers; the field is bool'),
        ((NUMBER, std("String", "{n}")), 'input "n" gives whole numbers; the field is string'),
        (
            ({**NUMBER, "step": 0.5}, std("Int32", "{n}")),
            'input "n" gives numbers; the field is int32',
        ),
        (
            ({**NUMBER, "min": 0.0}, std("Int32", "{n}")),
            'input "n" gives numbers; the field is int32',
        ),
        (
            ({**NUMBER, "max": 256}, std("UInt8", "{n}")),
            'input "n" gives 256; the field is uint8: 256 is out of range: uint8 goes from 0 to 255',
        ),
        (
            ({**NUMBER, "min": -1}, std("UInt8", "{n}")),
            'input "n" gives -1; the field is uint8: -1 is out of range: uint8 goes from 0 to 255',
        ),
        ((NUMBER, std("Int8", "{n}1")), '"{n}1" makes text; the field is int8'),
        (
            ({**SELECT, "options": [{"value": 300, "label": "x"}]}, std("UInt8", "{s}")),
            'input "s" gives 300; the field is uint8: 300 is out of range',
        ),
        (
            ({**SELECT, "options": [*SELECT["options"], {"value": "x", "label": "x"}]},
             std("UInt8", "{s}")),
            'input "s" gives "x"; the field is uint8',
        ),
        (
            ({**SELECT, "options": [{"value": [1], "label": "x"}]}, std("String", "a {s}")),
            "a list or a table can't stand in a text",
        ),
    ],
)  # fmt: skip
def test_an_input_of_another_type_is_reported_with_the_type_of_the_field(
    widgets: tuple[Mapping[str, Any], ...], fault: str
) -> None:
    (reported,) = faults(*widgets)
    assert reported.startswith(f"page[0].widget[1].message.data: {fault}")


def test_a_fault_deep_in_a_message_has_its_whole_place() -> None:
    message = {"linear": {**ZERO, "x": "{message}"}, "angular": ZERO}
    where = "page[0].widget[1].message.linear.x"
    assert faults(MESSAGE, sent(TWIST, message)) == [
        f'{where}: input "message" gives text; the field is float64'
    ]
    table = {**SELECT, "options": [{"value": {**ZERO, "y": "far"}, "label": "Far"}]}
    (reported,) = faults(table, sent(TWIST, {"linear": "{s}", "angular": ZERO}))
    gives = 'input "s" gives {x = 0, y = "far", z = 0}'
    assert reported == f"page[0].widget[1].message.linear.y: {gives}; the field is float64"


@pytest.mark.parametrize(
    ("widget", "fault"),
    [
        ({**NUMBER, "max": 0}, "max: 0 must be more than min (0)"),
        ({**NUMBER, "step": 3}, "step: no whole number of steps of 3 leads from 0 to 10"),
        ({**NUMBER, "default": 11}, "default: 11 is not from 0 to 10"),
        (
            {**NUMBER, "default": 0.5},
            "default: 0.5 is not on a step of 1 from 0; limits written as 0.0 and 10.0 take any number",
        ),
        ({**NUMBER, "min": 0.0, "default": 10.5}, "default: 10.5 is not from 0 to 10"),
        ({**SELECT, "default": 3}, "default: 3 is no option; there is 1, 2"),
        ({**SELECT, "default": True}, "default: true is no option"),
        (
            {**SELECT, "options": [{"value": 1, "label": "a"}, {"value": "1", "label": "b"}]},
            "options[1].value: 1 is already options[0]",
        ),
        (
            {**SELECT, "options": [{"value": 1, "label": "a"}, {"value": 2, "label": "a"}]},
            'options[1].label: "a" is already the label of options[0]',
        ),
        (
            {**HEARD, "type": "std_msgs/msg/Int8", "format": "d", "scale": 0.5},
            'format: "d" is for whole numbers; this is a scaled number',
        ),
        (
            {**HEARD, "type": "std_msgs/msg/Int8", "constants": "STATUS_"},
            "constants: no constant of std_msgs/msg/Int8 starts so; it has none",
        ),
        (
            {**HEARD, "type": "sensor_msgs/msg/NavSatStatus", "field": "status", "constants": "S"},
            "constants: STATUS_FIX and SERVICE_UNKNOWN are both 0: a longer prefix tells them apart, "
            "or a lamp",
        ),
        (
            {**HEARD, "type": IMAGE_FORMATS, "field": "datatype", "constants": "INT", "unit": "x"},
            "unit: is for numbers; constants are shown by their names",
        ),
        (
            {**LAMP, "type": "std_msgs/msg/Float64"},
            'field: "data" is float64: an indicator is for whole numbers, bools and texts',
        ),
        (
            {**LAMP, "type": "std_msgs/msg/Bool"},
            "states[0].value: must be true or false (bool), not 0",
        ),
        ({**LAMP, "type": TEXT}, "states[0].value: must be text (string), not 0"),
        (
            {**LAMP, "states": [{**STATES[0], "value": 256}]},
            "states[0].value: 256 is out of range: uint8 goes from 0 to 255",
        ),
        (
            {**LAMP, "states": [{**STATES[0], "value": True}]},
            "states[0].value: must be a whole number (uint8), not true",
        ),
        (
            {**LAMP, "states": [*STATES, {**STATES[0], "shape": "bar"}]},
            "states[1].value: 0 is already the value of states[0]",
        ),
        (
            {**LAMP, "states": [*STATES, {**STATES[0], "value": 1, "colour": "red"}]},
            "states[1]: has the shape and text of states[0]: only the colour would tell them apart",
        ),
    ],
)  # fmt: skip
def test_a_fault_of_an_input_or_a_display_is_reported(widget: Mapping[str, Any], fault: str) -> None:
    (reported,) = faults(widget)
    assert reported.startswith(f"page[0].widget[0].{fault}")


STAMPED = "geometry_msgs/msg/TwistStamped"
PATH = "nav_msgs/msg/Path"
NOW_IS = '"{now}", alone, is the time of sending and fills a builtin_interfaces/msg/Time'


@pytest.mark.parametrize(
    "widget",
    [
        sent("builtin_interfaces/msg/Time", {}),
        sent("std_msgs/msg/Header", {"stamp": "{now}"}),
        sent(STAMPED, {"header": {"stamp": "{now}", "frame_id": "{message}"}}),
        sent(PATH, {"poses": [{}, {"header": {"stamp": "{now}"}}]}),
        {**sent(STAMPED, {"header": {"stamp": "{now}"}}), "kind": "hold", "interlock": "operation",
         "release": {"header": {"stamp": "{now}"}}},
        {"id": "plan", "kind": "call", "label": "P", "service": "/plan", "type": "nav_msgs/srv/GetPlan",
         "request": {"start": {"header": {"stamp": "{now}"}}}},
    ],
)  # fmt: skip
def test_now_fills_a_time_anywhere_in_a_message(widget: Mapping[str, Any]) -> None:
    assert faults(MESSAGE, widget) == []


@pytest.mark.parametrize(
    ("type_name", "message", "place", "fault"),
    [
        (TEXT, {"data": "{now}"}, "data", f"{NOW_IS}; the field is string"),
        (TEXT, {"data": "at {now}"}, "data", f"{NOW_IS}; the field is string"),
        ("std_msgs/msg/Int32", {"data": "{now}"}, "data", f"{NOW_IS}; the field is int32"),
        (
            "builtin_interfaces/msg/Duration",
            {"sec": "{now}"},
            "sec",
            f"{NOW_IS}; the field is int32",
        ),
        (STAMPED, {"header": "{now}"}, "header", f"{NOW_IS}; the field is std_msgs/msg/Header"),
        (STAMPED, {"header": {"stamp": "{now}{now}"}}, "header.stamp", f"{NOW_IS}; the field is built"),
        (STAMPED, {"header": {"stamps": "{now}"}}, "header.stamps", "unknown field; std_msgs/msg/Head"),
        (
            PATH,
            {"poses": [{}, {"pose": "{now}"}]},
            "poses[1].pose",
            f"{NOW_IS}; the field is geometry_msgs/msg/Pose",
        ),
        (
            "trajectory_msgs/msg/JointTrajectory",
            {"points": [{"time_from_start": "{now}"}]},
            "points[0].time_from_start",
            f"{NOW_IS}; the field is builtin_interfaces/msg/Duration",
        ),
    ],
)
def test_now_fills_nothing_but_a_time(
    type_name: str, message: dict[str, Any], place: str, fault: str
) -> None:
    reported = faults(sent(type_name, message))
    assert {text.split(": ")[0] for text in reported} == {f"page[0].widget[0].message.{place}"}
    assert reported[0].startswith(f"page[0].widget[0].message.{place}: {fault}")


@pytest.mark.parametrize("kind", ["text", "toggle", "parameter"])
def test_no_input_is_called_now(kind: str) -> None:
    table: Mapping[str, Any] = {"text": MESSAGE, "toggle": TOGGLE, "parameter": PARAMETER}[kind]
    assert faults({**table, "id": "now"}, std("String", "{now}")) == [
        f'page[0].widget[0].id: "now" is reserved, as {NOW_IS}: choose another id'
    ]
    assert faults({**std("String", "x"), "id": "now"}) == []


@pytest.mark.parametrize("step", [0.1, 0.7, 1e-7])
def test_steps_are_counted_as_they_are_written(step: float) -> None:
    assert faults({**NUMBER, "min": -0.7, "max": 0.7, "step": step}) == []


BEST_EFFORT = {"reliability": "best_effort"}


def test_a_topic_has_one_qos() -> None:
    again = {**GUARDED, "topic": "/free", "qos": {"depth": 1}}
    assert faults(MESSAGE, FREE, again) == [
        "page[0].widget[2].qos: /free has another QoS at page[0].widget[1]: a topic has one"
    ]
    heard = {**HEARD, "topic": ENABLED, "type": "std_msgs/msg/Bool"}
    lossy = {"qos": BEST_EFFORT, "max_age_s": 1.0}
    assert faults(heard, interlock=lossy) == [
        f"page[0].widget[0].qos: {ENABLED} has another QoS at interlock[0]: a topic has one"
    ]
    assert faults({**heard, "qos": BEST_EFFORT}, interlock=lossy) == []


def test_a_topics_qos_is_found_by_its_name() -> None:
    panel = panel_of(MESSAGE, FREE, {**HEARD, "qos": {"durability": "transient_local"}})
    assert panel.qos("/free") == TopicQos()
    assert panel.qos(ENABLED) == TopicQos()
    assert panel.qos("/heard").wire_qos.transient_local


def test_faults_that_follow_from_a_reported_fault_are_not_reported() -> None:
    panel = panel_of(MESSAGE, std("Float64", "{message}"))
    assert list(find_faults(panel, INTERFACES, {"message"})) == []
    assert [type(f) for f in find_faults(panel, INTERFACES, {"other"})] == [Fault]


@pytest.mark.parametrize(
    "more",
    [
        {"min": 0, "max": 2, "step": 0.1, "unit": "m/s"},
        {"type": "integer", "min": -5, "max": 5, "step": 2, "interlock": "operation"},
        {"type": "bool", "on": "Open", "off": "Closed"},
        {"type": "string", "parameter": "qos_overrides./tf.publisher.depth"},
        {"node": "/cell1/arm", "timeout_s": 0.5},
    ],
)
def test_a_parameter_that_fits_has_no_fault(more: dict[str, Any]) -> None:
    assert faults({**PARAMETER, **more}) == []


@pytest.mark.parametrize("distro", DISTROS)
def test_every_distribution_has_the_services_of_parameters(distro: str) -> None:
    interfaces = load_interfaces(distro)

    def fields(type_name: str) -> list[str]:
        return [field.name for field in interfaces.structures[type_name].fields]

    of_services = {
        GET: (["names"], ["values"]),
        DESCRIBE: (["names"], ["descriptors"]),
        SET: (["parameters"], ["results"]),
    }
    for (_, type_name), (request, response) in of_services.items():
        assert [fields(service_type) for service_type in interfaces.service_types(type_name)] == [
            request,
            response,
        ]
    changes = ["new_parameters", "changed_parameters", "deleted_parameters"]
    assert fields(EVENT_TYPE) == ["stamp", "node", *changes]


@pytest.mark.parametrize(
    ("more", "fault"),
    [
        ({"type": "bool", "min": 0}, '.min: is for numbers; the type is "bool"'),
        ({"type": "string", "unit": "m"}, '.unit: is for numbers; the type is "string"'),
        ({"type": "integer", "step": 0.5}, ".step: 0.5 must be whole: the type is integer"),
        ({"min": 2, "max": 1}, ".max: 1 must be more than min (2)"),
        (
            {"min": 0, "max": 1, "step": 0.3},
            ".step: no whole number of steps of 0.3 leads from 0 to 1",
        ),
        ({"interlock": "door"}, '.interlock: no interlock "door"; there is operation'),
    ],
)
def test_a_parameter_that_does_not_fit_is_reported(more: dict[str, Any], fault: str) -> None:
    assert faults({**PARAMETER, **more}) == [f"page[0].widget[0]{fault}"]


def test_a_parameter_has_one_type_in_a_panel() -> None:
    assert faults(PARAMETER, {**PARAMETER, "id": "q", "type": "string"}) == [
        "page[0].widget[1].type: speed of /arm is string here but double above"
    ]


@pytest.mark.parametrize(
    ("more", "fault"),
    [
        ({"node": "arm"}, "is not the absolute name of a ROS 2 node: it must be like /cell1"),
        ({"type": "float"}, "'bool', 'integer', 'double', 'string', 'bool.*'"),
        ({"parameter": "a b"}, "should match pattern"),
        ({"parameter": "a" * 256}, "at most 255 characters"),
        ({"step": 0}, "greater than 0"),
    ],
)
def test_a_parameter_whose_shape_is_wrong_is_reported(more: dict[str, Any], fault: str) -> None:
    with pytest.raises(ValidationError, match=fault):
        panel_of({**PARAMETER, **more})


def test_a_panel_with_parameters_listens_to_their_events() -> None:
    panel = panel_of(PARAMETER)
    assert panel.subscriptions()["/parameter_events"] == "rcl_interfaces/msg/ParameterEvent"
    assert panel.qos("/parameter_events") == TopicQos(durability="volatile", depth=1000)
    assert "/parameter_events" not in panel_of(FREE).subscriptions()


def test_a_bar_code_goes_to_one_input_of_a_page() -> None:
    first, second = ({**MESSAGE, "id": name, "scan": True} for name in ("order", "pallet"))
    assert faults(first, {**second, "scan": False}) == []
    assert faults(first, second) == [
        'page[0].widget[1].scan: "order" has it already: a bar code goes to one input of a page'
    ]


TIMES: Final = {
    TIME: ("std_msgs/msg/Header", "stamp"),
    DURATION: ("visualization_msgs/msg/Marker", "lifetime"),
    "string": ("std_msgs/msg/String", "data"),
    "float64": ("std_msgs/msg/Float64", "data"),
}


@pytest.mark.parametrize(
    ("kind", "more", "key"),
    [
        (TIME, {"format": ".1f"}, "format"),
        (TIME, {"unit": "s"}, "unit"),
        (TIME, {"scale": 2}, "scale"),
        (DURATION, {"format": "age"}, "format"),
        ("string", {"format": "time"}, "format"),
        ("float64", {"format": "age", "unit": "s"}, "unit"),
        (TIME, {}, ""),
        (TIME, {"format": "age"}, ""),
        (TIME, {"format": "duration"}, ""),
        (DURATION, {"format": "duration"}, ""),
        ("float64", {"format": "time", "scale": 1e-9}, ""),
    ],
)
def test_time_has_its_own_formats(kind: str, more: dict[str, Any], key: str) -> None:
    type_name, field = TIMES[kind]
    reported = faults({**HEARD, "type": type_name, "field": field, **more})
    assert [text.partition(": ")[0] for text in reported] == (
        [f"page[0].widget[0].{key}"] if key else []
    )

"""ROS 2 definitions and CDR: what goes out is checked, what comes in is a message or a DecodeError."""

import math
import random
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import pytest
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore

from app.ros.messages import DISTROS, INTEGER_RANGES, PLACEHOLDER, load_interfaces
from app.ros.messages.make_builtin import ALIASES
from app.ros.messages.names import MESSAGE_TYPE
from app.system.errors import DecodeError, FieldError, InterfaceError
from tests.support.builders import BOOL, INTERFACES, TEXT

pytestmark = pytest.mark.promise("values")

SOLID = "shape_msgs/msg/SolidPrimitive"
POSE = "geometry_msgs/msg/PoseWithCovariance"
PATTERN = "Aé漢🤖"


class Sample:
    """Fields for any type, each value unlike the last, at the edges of its range."""

    def __init__(self, distro: str) -> None:
        self._definitions = get_typestore(Stores(f"ros2_{ALIASES.get(distro, distro)}")).fielddefs
        self._turn = 0
        self.types = tuple(self._definitions)

    def fields(self, type_name: str) -> dict[str, Any]:
        fields = self._definitions[type_name][1]
        return {name: self._value(is_a) for name, is_a in fields if name != PLACEHOLDER}

    def _value(self, definition: Any) -> Any:
        kind, detail = definition
        if kind == Nodetype.NAME:
            return self.fields(detail)
        if kind == Nodetype.BASE:
            return self._base(*detail)
        inner, size = detail
        length = size if kind == Nodetype.ARRAY else min(size or 2, 2)
        return [self._value(inner) for _ in range(length)]

    def _base(self, name: str, bound: int) -> Any:
        self._turn += 1
        if name == "byte":
            return self._turn % 128
        if name in INTEGER_RANGES:
            return INTEGER_RANGES[name][self._turn % 2]
        if name == "bool":
            return bool(self._turn % 2)
        if name.startswith("float"):
            return self._turn * -0.5
        return (PATTERN * (self._turn % 3))[: bound // 4 if bound else None]


def fields_of(value: Any, like: Any) -> Any:
    """The fields of a decoded message that are in `like`, as plain values."""
    if isinstance(like, Mapping):
        return {name: fields_of(getattr(value, name), inner) for name, inner in like.items()}
    if isinstance(value, memoryview):
        return value.tolist()
    if isinstance(like, list):
        return [fields_of(item, inner) for item, inner in zip(value, like, strict=True)]
    return value


@pytest.mark.parametrize("distro", list(DISTROS))
def test_every_type_comes_back_as_it_went(distro: str) -> None:
    interfaces, sample = load_interfaces(distro), Sample(distro)
    assert len(sample.types) >= 150
    for type_name in sample.types:
        fields = sample.fields(type_name)
        message = interfaces.decode(type_name, interfaces.encode(type_name, fields))
        assert fields_of(message, fields) == fields, type_name


@pytest.mark.parametrize("distro", list(DISTROS))
def test_every_type_can_be_named_by_a_panel(distro: str) -> None:
    assert [name for name in Sample(distro).types if not MESSAGE_TYPE.fullmatch(name)] == []


@pytest.mark.parametrize(
    ("type_name", "field", "distros"),
    [
        ("geometry_msgs/msg/Pose2D", "theta", ["humble", "iron", "jazzy", "kilted"]),
        ("nav_msgs/msg/Goals", "goals", ["kilted", "lyrical", "rolling"]),
        ("lifecycle_msgs/msg/TransitionEvent", "timestamp", ["humble", "iron", "jazzy", "kilted"]),
        ("lifecycle_msgs/msg/TransitionEvent", "stamp", ["lyrical", "rolling"]),
    ],
)
def test_each_distribution_has_its_own_messages(type_name: str, field: str, distros: list[str]) -> None:
    has = {d: load_interfaces(d).structures.get(type_name) for d in DISTROS}
    assert [
        d for d, structure in has.items() if structure and field in [f.name for f in structure.fields]
    ] == distros


@pytest.mark.parametrize(
    ("type_name", "fields", "payload"),
    [
        (BOOL, {"data": True}, b"\0\1\0\0\1"),
        (BOOL, {"data": False}, b"\0\1\0\0\0"),
        (TEXT, {"data": "hello"}, b"\0\1\0\0\6\0\0\0hello\0"),
        (TEXT, {"data": ""}, b"\0\1\0\0\1\0\0\0\0"),
        ("std_msgs/msg/Empty", {}, b"\0\1\0\0\0"),
        ("std_msgs/msg/Int16", {"data": -2}, b"\0\1\0\0\xfe\xff"),
        ("builtin_interfaces/msg/Time", {"sec": 1, "nanosec": 2}, b"\0\1\0\0\1\0\0\0\2\0\0\0"),
        (
            "std_msgs/msg/Header",
            {"stamp": {"sec": 1, "nanosec": 2}, "frame_id": "a"},
            b"\0\1\0\0\1\0\0\0\2\0\0\0\2\0\0\0a\0",
        ),
    ],
)
def test_a_message_has_the_bytes_that_ros_gives_it(
    type_name: str, fields: Mapping[str, Any], payload: bytes
) -> None:
    assert INTERFACES.encode(type_name, fields) == payload
    assert fields_of(INTERFACES.decode(type_name, payload), fields) == fields


def test_a_big_endian_message_is_read() -> None:
    assert INTERFACES.decode("std_msgs/msg/Int32", b"\0\0\0\0\0\0\1\0").data == 256


def test_type_hash_equals_that_of_ros() -> None:
    assert INTERFACES.type_hash(TEXT) == (
        "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
    )


@pytest.mark.parametrize(
    ("type_name", "value", "why"),
    [
        (BOOL, 1, "true or false"),
        (BOOL, "true", "true or false"),
        (BOOL, None, "true or false"),
        (TEXT, 5, "must be text"),
        (TEXT, b"hello", "must be text"),
        (TEXT, ["hello"], "must be text"),
        (TEXT, "a\0b", "NUL"),
        (TEXT, "\ud800", "surrogate"),
        ("std_msgs/msg/Int8", 128, "int8 goes from -128 to 127"),
        ("std_msgs/msg/Int8", -129, "out of range"),
        ("std_msgs/msg/UInt8", -1, "uint8 goes from 0 to 255"),
        ("std_msgs/msg/Byte", 256, "out of range"),
        ("std_msgs/msg/Char", -1, "out of range"),
        ("std_msgs/msg/UInt64", 2**64, "out of range"),
        ("std_msgs/msg/Int64", -(2**63) - 1, "out of range"),
        ("std_msgs/msg/Int32", True, "whole number"),
        ("std_msgs/msg/Int32", 1.0, "whole number"),
        ("std_msgs/msg/Int32", "1", "whole number"),
        ("std_msgs/msg/Float32", 1e39, "out of range"),
        ("std_msgs/msg/Float32", -1e39, "out of range"),
        ("std_msgs/msg/Float64", 10**400, "out of range"),
        ("std_msgs/msg/Float64", "1.0", "must be a number"),
        ("std_msgs/msg/Float64", False, "must be a number"),
    ],
)
def test_a_value_that_does_not_fit_is_refused(type_name: str, value: Any, why: str) -> None:
    with pytest.raises(FieldError, match=why) as caught:
        INTERFACES.encode(type_name, {"data": value})
    assert caught.value.field == "data"


@pytest.mark.parametrize("name", [n for n in INTEGER_RANGES if n not in ("octet", "byte", "char")])
def test_an_integer_takes_its_whole_range(name: str) -> None:
    type_name = f"std_msgs/msg/{name.replace('int', 'Int').replace('uI', 'UI')}"
    for value in INTEGER_RANGES[name]:
        assert INTERFACES.decode(type_name, INTERFACES.encode(type_name, {"data": value})).data == value


@pytest.mark.parametrize("value", [math.inf, -math.inf, math.nan])
@pytest.mark.parametrize("type_name", ["std_msgs/msg/Float32", "std_msgs/msg/Float64"])
def test_a_float_may_be_infinite_or_not_a_number(type_name: str, value: float) -> None:
    data = INTERFACES.decode(type_name, INTERFACES.encode(type_name, {"data": value})).data
    assert data == value or (math.isnan(data) and math.isnan(value))


def test_a_whole_number_may_stand_for_a_float() -> None:
    payload = INTERFACES.encode("std_msgs/msg/Float64", {"data": 3})
    assert INTERFACES.decode("std_msgs/msg/Float64", payload).data == 3.0


@pytest.mark.parametrize(
    ("type_name", "fields", "place", "why"),
    [
        (TEXT, {"data": "x", "dat": "y"}, "dat", "unknown field; std_msgs/msg/String has data"),
        ("std_msgs/msg/Empty", {"data": 1}, "data", "unknown field; std_msgs/msg/Empty has none"),
        (
            "std_msgs/msg/Header",
            {"stamp": {"secs": 1}},
            "stamp.secs",
            "unknown field; .* has sec, nanosec",
        ),
        ("std_msgs/msg/Header", {"stamp": 1, "frame_id": ""}, "stamp", "must be a table"),
        (
            "std_msgs/msg/Header",
            {"stamp": {"sec": 1, "nanosec": -1}, "frame_id": ""},
            "stamp.nanosec",
            "out of range",
        ),
        (
            "sensor_msgs/msg/JointState",
            {
                "header": {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""},
                "name": ["a", 2],
                "position": [],
                "velocity": [],
                "effort": [],
            },
            "name[1]",
            "must be text",
        ),
        ("geometry_msgs/msg/Polygon", {"points": [{}, {"w": 0}]}, "points[1].w", "has x, y, z"),
        ("geometry_msgs/msg/Polygon", {"points": "none"}, "points", "must be a list"),
        ("geometry_msgs/msg/Polygon", {"points": {"x": 0}}, "points", "must be a list"),
        (
            "unique_identifier_msgs/msg/UUID",
            {"uuid": [0] * 15},
            "uuid",
            "must have 16 elements, not 15",
        ),
        ("unique_identifier_msgs/msg/UUID", {"uuid": [0] * 15 + [256]}, "uuid[15]", "out of range"),
    ],
)
def test_a_fault_names_its_place_in_the_message(
    type_name: str, fields: Mapping[str, Any], place: str, why: str
) -> None:
    with pytest.raises(FieldError, match=why) as caught:
        INTERFACES.encode(type_name, fields)
    assert caught.value.field == place


@pytest.mark.parametrize(
    ("type_name", "fields", "whole"),
    [
        (TEXT, {}, {"data": ""}),
        ("std_msgs/msg/Header", {"stamp": {"sec": 1}}, {
            "stamp": {"sec": 1, "nanosec": 0}, "frame_id": ""}),
        ("geometry_msgs/msg/Polygon", {"points": [{"x": 1}, {}]}, {
            "points": [{"x": 1.0, "y": 0.0, "z": 0.0}, {"x": 0.0, "y": 0.0, "z": 0.0}]}),
        (POSE, {"pose": {"position": {"x": 1}}}, {
            "pose": {
                "position": {"x": 1.0, "y": 0.0, "z": 0.0},
                "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
            },
            "covariance": [0.0] * 36}),
        ("sensor_msgs/msg/NavSatStatus", {}, {"status": -2, "service": 0}),
        ("unique_identifier_msgs/msg/UUID", {}, {"uuid": [0] * 16}),
        (SOLID, {}, {"type": 0, "dimensions": [], "polygon": {"points": []}}),
    ],
)  # fmt: skip
def test_omitted_field_has_its_default_or_is_zero(
    type_name: str, fields: Mapping[str, Any], whole: Mapping[str, Any]
) -> None:
    assert INTERFACES.encode(type_name, fields) == INTERFACES.encode(type_name, whole)
    assert fields_of(INTERFACES.decode(type_name, INTERFACES.encode(type_name, fields)), whole) == whole


def test_a_bounded_list_takes_no_more_than_its_bound() -> None:
    assert INTERFACES.field_type(SOLID, "dimensions") == "float64[<=3]"
    fields = {"type": 1, "dimensions": [1, 2, 3], "polygon": {"points": []}}
    assert INTERFACES.encode(SOLID, fields)
    with pytest.raises(FieldError, match="may have 3 elements at most, not 4"):
        INTERFACES.encode(SOLID, {**fields, "dimensions": [1, 2, 3, 4]})


def test_a_bounded_text_takes_no_more_bytes_than_its_bound() -> None:
    described = "type_description_interfaces/msg/FieldType"
    fields = {"type_id": 1, "capacity": 0, "string_capacity": 0, "nested_type_name": "é" * 127}
    assert INTERFACES.field_type(described, "nested_type_name") == "string<=255"
    assert INTERFACES.encode(described, fields)
    with pytest.raises(FieldError, match="256 bytes long; string<=255 takes 255") as caught:
        INTERFACES.encode(described, {**fields, "nested_type_name": "é" * 128})
    assert caught.value.field == "nested_type_name"


@pytest.mark.parametrize(
    ("type_name", "path", "written"),
    [
        (BOOL, "data", "bool"),
        ("std_msgs/msg/Header", "stamp.sec", "int32"),
        ("std_msgs/msg/Header", "stamp", "builtin_interfaces/msg/Time"),
        (POSE, "covariance", "float64[36]"),
        (POSE, "pose.position.x", "float64"),
        ("sensor_msgs/msg/JointState", "name", "string[]"),
    ],
)
def test_a_field_has_the_type_of_its_definition(type_name: str, path: str, written: str) -> None:
    assert INTERFACES.field_type(type_name, path) == written


@pytest.mark.parametrize(
    ("type_name", "path", "why"),
    [
        (BOOL, "value", 'no "value" .*std_msgs/msg/Bool has data'),
        (BOOL, "data.value", 'no "value" .*bool has no fields'),
        (POSE, "covariance.x", 'no "x" .*has no fields'),
        ("std_msgs/msg/Header", "stamp.secs", 'no "secs" .*Time has sec, nanosec'),
        ("std_msgs/msg/Empty", PLACEHOLDER, "has no fields"),
        (BOOL, "", '"" is not a field: it must be like pose.x'),
    ],
)
def test_a_field_that_is_not_there_is_refused_with_those_that_are(
    type_name: str, path: str, why: str
) -> None:
    with pytest.raises(InterfaceError, match=why):
        INTERFACES.field_type(type_name, path)


def test_an_unknown_type_is_refused_with_the_nearest() -> None:
    for type_name, near in (
        ("std_msgs/msg/Strng", "std_msgs/msg/String?"),
        ("std_msg/msg/String", "std_msgs/msg/String or "),
        ("std_msgs/msg/Twist", "geometry_msgs/msg/Twist?"),
        ("geometry_msgs/msg/PoseStamp", "geometry_msgs/msg/PoseStamped or geometry_msgs/msg/Po"),
    ):
        with pytest.raises(InterfaceError) as caught:
            INTERFACES.require(type_name)
        assert f"ROS 2 jazzy; did you mean {near}" in str(caught.value)


def test_a_package_that_is_nowhere_is_a_fault() -> None:
    with pytest.raises(InterfaceError, match=r"there is no package cell_msgs: its folder") as caught:
        INTERFACES.require("cell_msgs/msg/Jog")
    assert caught.value.package == "cell_msgs"


def test_a_type_like_none_is_refused_without_a_guess() -> None:
    with pytest.raises(InterfaceError) as caught:
        INTERFACES.require("???")
    assert "did you mean" not in str(caught.value)


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"\0\1",
        b"\0\1\0\0",
        b"true!",
        b"\xff\xff\xff\xff\1",
        b"\0\7\0\0\1",  # XCDR2
        b"\0\3\0\0\1",  # a parameter list
        b"\0\1\0\0\1and more",
        b"\0\1\0\0\6\0\0\0hello\0",
        b"\0\1\0\0\2",
        b"\0\1\0\0\x80",
        b"\0\1\0\0\xff",
        b"\0\1\0\0\1\0",  # longer than a bool, and not padded to four bytes
        b"\0\1\0\0\1\0\0",
        b"\0\1\0\0\1\0\0\0\0",
    ],
)
def test_bytes_that_are_not_a_bool_never_permit(data: bytes) -> None:
    with pytest.raises(DecodeError, match=f"{len(data)} bytes are not a std_msgs/msg/Bool"):
        INTERFACES.decode(BOOL, data)


def test_a_message_may_be_padded_to_four_bytes_and_no_further() -> None:
    assert INTERFACES.decode(BOOL, b"\0\1\0\0\1\0\0\0").data is True
    text = b"\0\1\0\0\2\0\0\0a\0"
    assert INTERFACES.decode(TEXT, text + b"\0\0").data == "a"
    for much in (1, 3, 4):
        with pytest.raises(DecodeError, match="it ends at 10"):
            INTERFACES.decode(TEXT, text + bytes(much))


def test_random_bodies_are_hardly_ever_a_bool() -> None:
    chance = random.Random(1)
    bodies = [chance.randbytes(chance.randrange(1, 65)) for _ in range(20_000)]
    read = [body for body in bodies if readable(BOOL, body)]
    assert all(len(body) in (1, 4) and body[0] in (0, 1) for body in read)
    assert len(read) < 20


def readable(type_name: str, body: bytes) -> bool:
    try:
        INTERFACES.decode(type_name, b"\0\1\0\0" + body)
    except DecodeError:
        return False
    return True


@pytest.mark.parametrize("byte", [0, 1, 2, 128, 255])
def test_a_bool_among_other_bytes_is_0_or_1(byte: int) -> None:
    type_name = "rcl_interfaces/msg/ParameterValue"
    fields = {
        "type": 1,
        "bool_value": True,
        "integer_value": 0,
        "double_value": 0.0,
        "string_value": "",
        "byte_array_value": [],
        "bool_array_value": [True, False],
        "integer_array_value": [],
        "double_array_value": [],
        "string_array_value": [],
    }
    whole = INTERFACES.encode(type_name, fields)
    listed = whole.index(b"\2\0\0\0\1\0") + 4
    readers: dict[int, Callable[[Any], Any]] = {
        5: lambda message: message.bool_value,
        listed: lambda message: message.bool_array_value[0],
    }
    for place, read in readers.items():
        changed = whole[:place] + bytes([byte]) + whole[place + 1 :]
        if byte > 1:
            with pytest.raises(DecodeError, match=f"a bool is {byte}, not 0 or 1"):
                INTERFACES.decode(type_name, changed)
        else:
            assert read(INTERFACES.decode(type_name, changed)) is bool(byte)


@pytest.mark.parametrize(
    "text",
    [
        b"\xff\xff\xff\xffhello\0",  # a length beyond the end
        b"\0\0\0\0",  # no room for the terminator
        b"\5\0\0\0hello",  # no terminator
        b"\3\0\0\0\xff\xfe\0",  # not UTF-8
    ],
)
def test_a_broken_text_is_not_a_message(text: bytes) -> None:
    with pytest.raises(DecodeError):
        INTERFACES.decode(TEXT, b"\0\1\0\0" + text)


@pytest.mark.parametrize("type_name", [TEXT, "std_msgs/msg/Header", POSE, "sensor_msgs/msg/JointState"])
def test_a_message_that_was_cut_off_is_not_a_message(type_name: str) -> None:
    whole = INTERFACES.encode(type_name, Sample("jazzy").fields(type_name))
    for length in range(len(whole)):
        with pytest.raises(DecodeError):
            INTERFACES.decode(type_name, whole[:length])


def garbage(seed: int) -> Iterator[bytes]:
    chance = random.Random(seed)
    for size in (0, 1, 3, 4, 5, 8, 16, 33, 64, 200):
        yield chance.randbytes(size)
        yield b"\0\1\0\0" + chance.randbytes(size)
        yield b"\0\1\0\0" + bytes(chance.choices((0, 1, 255), k=size))


def test_garbage_raises_nothing_but_a_decode_error() -> None:
    refused = 0
    for seed, type_name in enumerate(Sample("jazzy").types):
        for data in garbage(seed):
            try:
                INTERFACES.decode(type_name, data)
            except DecodeError:
                refused += 1
    assert refused > 1000


def test_a_distribution_is_read_once() -> None:
    assert load_interfaces("humble") is load_interfaces("humble")

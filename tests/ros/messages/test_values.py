"""Values on their way: what is taken for a list, for text and for numbers, and what a browser gets."""

import json
import math
from array import array
from collections.abc import Callable, Iterator
from datetime import date, datetime
from datetime import time as clock
from pathlib import Path
from typing import Any, Final

import numpy
import pytest

from app.ros.cdr import codec
from app.ros.messages import DISTROS, Interfaces, load_interfaces, plain_text, to_plain
from app.ros.messages.validation import format_value
from app.system.errors import DecodeError, FieldError, InterfaceError
from tests.ros.messages.test_interfaces import garbage
from tests.support.form import LONG, several
from tests.support.samples import Samples

pytestmark = pytest.mark.promise("values")

EVERYTHING: Final = "cell_msgs/msg/Everything"
FIELDS: Final = """
bool on
byte mask
char letter
int64 low
uint64 high
float32 small
float64 large
string<=4 name
wstring title
wstring<=2 short
bool[] flags
byte[2] pair
uint8[] data
int8[<=3] steps
uint16[] shorts
int64[] longs
uint64[] counts
float32[] reals
float64[3] at
string[] words
wstring[<=2] titles
std_msgs/Empty nothing
std_msgs/Empty[] nothings
builtin_interfaces/Time[2] times
"""
JAZZY: Final = load_interfaces("jazzy")
ARRAY: Final = "std_msgs/msg/UInt8MultiArray"
REALS: Final = "std_msgs/msg/Float32MultiArray"
LAYOUT: Final = {"layout": {"dim": [], "data_offset": 0}}


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Interfaces:
    folder: Path = tmp_path_factory.mktemp("share") / "cell_msgs/msg"
    folder.mkdir(parents=True)
    (folder / "Everything.msg").write_text(FIELDS)
    return Interfaces("jazzy", [folder.parent])


@pytest.fixture
def good(cell: Interfaces) -> dict[str, Any]:
    return Samples(cell.structures, 1).fields(EVERYTHING, "most")


def test_every_kind_of_field_comes_back_as_it_went(cell: Interfaces) -> None:
    for seed in range(several(50, 200)):
        fields = Samples(cell.structures, seed).fields(EVERYTHING)
        payload = cell.encode(EVERYTHING, fields)
        plain = to_plain(cell.decode(EVERYTHING, payload))
        assert json.dumps(plain) == json.dumps(to_plain_fields(fields)), seed


def test_a_values_text_is_that_of_its_plain_value(cell: Interfaces) -> None:
    for seed in range(several(30, 100)):
        fields = Samples(cell.structures, seed).fields(EVERYTHING)
        message = cell.decode(EVERYTHING, cell.encode(EVERYTHING, fields))
        whole = str(to_plain(message))
        assert plain_text(message, len(whole)) == whole, seed
        assert plain_text(message, 100) == whole[:99] + "…", seed
        for field in cell.structures[EVERYTHING].fields:
            value = getattr(message, field.attribute)
            assert plain_text(value, 10**9) == str(to_plain(value)), (seed, field.name)


class Endless(list[int]):
    """A list of which only the beginning may be looked at."""

    def __iter__(self) -> Iterator[int]:
        yield from range(100)
        raise AssertionError("read on")


def test_a_long_list_is_written_by_its_head_only() -> None:
    assert plain_text(Endless([1] * 1000), 20) == "[0, 1, 2, 3, 4, 5, …"
    assert plain_text("x" * 21, 20) == "x" * 19 + "…"


def to_plain_fields(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: to_plain_fields(inner) for name, inner in value.items()}
    return [to_plain_fields(item) for item in value] if isinstance(value, list) else to_plain(value)


@pytest.mark.parametrize(
    ("name", "value", "place", "why"),
    [
        ("mask", 256, "mask", "byte goes from 0 to 255"),
        ("name", "fünf", "name", r"is 5 bytes long; string<=4 takes 4 at most"),
        ("short", "a🤖", "short", r"is 3 UTF-16 units long; wstring<=2 takes 2 at most"),
        ("title", 5, "title", r"must be text \(wstring\), not 5"),
        ("title", "\ud800", "title", "half of a surrogate pair"),
        ("title", "a\0b", "title", "NUL"),
        ("titles", ["a", "b", "c"], "titles", "may have 2 elements at most, not 3"),
        ("titles", ["a", 5], "titles[1]", "must be text"),
        ("flags", [True, 1], "flags[1]", "true or false"),
        ("pair", [1, 2, 3], "pair", "must have 2 elements, not 3"),
        ("pair", b"abc", "pair", "must have 2 elements, not 3"),
        ("data", "abc", "data", r'must be a list \(uint8\[\]\), not "abc"'),
        ("data", [0, 256], "data[1]", "out of range"),
        ("data", [0, -1], "data[1]", "out of range"),
        ("data", [0, True], "data[1]", "whole number"),
        ("data", [0.0], "data[0]", "whole number"),
        ("data", numpy.array([1, 300]), "data[1]", "300 is out of range"),
        ("data", numpy.array([0.5]), "data[0]", "whole number"),
        ("data", numpy.array([True]), "data[0]", "whole number"),
        ("data", numpy.zeros((2, 2), numpy.uint8), "data", "must be a list"),
        ("data", {"a": 1}, "data", "must be a list"),
        ("data", 5, "data", "must be a list"),
        ("data", None, "data", "must be a list"),
        ("steps", b"abc", "steps", "must be a list"),
        ("steps", [1, 2, 3, 4], "steps", "may have 3 elements at most, not 4"),
        ("longs", [2**63], "longs[0]", "out of range"),
        ("counts", numpy.array([-1]), "counts[0]", "out of range"),
        ("reals", [0, 1e39], "reals[1]", "out of range: float32 goes to 3.40282e"),
        ("reals", numpy.array([0, -1e39]), "reals[1]", "out of range"),
        ("reals", ["1"], "reals[0]", "must be a number"),
        ("reals", [10**400], "reals[0]", "out of range"),
        ("at", [1, 2], "at", "must have 3 elements, not 2"),
        ("nothing", {"a": 1}, "nothing.a", "unknown field; std_msgs/msg/Empty has none"),
        ("nothing", None, "nothing", "must be a table"),
        ("nothings", [{}, 1], "nothings[1]", "must be a table"),
        ("times", [{"sec": 1}, {"nsec": 2}], "times[1].nsec", "unknown field"),
        ("times", [{"sec": 1, "nanosec": 2}, {"sec": 1, "nanosec": 2.5}], "times[1].nanosec", "whole"),
    ],
)
def test_a_value_that_does_not_fit_is_named(
    cell: Interfaces, good: dict[str, Any], name: str, value: Any, place: str, why: str
) -> None:
    cell.encode(EVERYTHING, good)
    with pytest.raises(FieldError, match=why) as caught:
        cell.encode(EVERYTHING, {**good, name: value})
    assert caught.value.field == place


def test_a_long_value_makes_no_long_error() -> None:
    with pytest.raises(FieldError) as caught:
        JAZZY.encode("std_msgs/msg/Int8", {"data": "x" * 1_000_000})
    assert len(str(caught.value)) < 200


@pytest.mark.parametrize(
    "data",
    [
        b"\0\1\xff",
        bytearray(b"\0\1\xff"),
        memoryview(b"\0\1\xff"),
        [0, 1, 255],
        (0, 1, 255),
        range(0, 256, 1)[0:2],
        numpy.array([0, 1, 255], numpy.uint8),
        numpy.array([0, 1, 255], ">i8"),
        numpy.array([0, 9, 1, 9, 255], numpy.uint8)[::2],
        [numpy.uint8(0), numpy.int64(1), 255],
    ],
    ids=lambda data: type(data).__name__,
)
def test_a_list_of_bytes_may_be_given_in_many_ways(data: Any) -> None:
    payload = JAZZY.encode(ARRAY, {**LAYOUT, "data": data})
    assert payload.endswith(bytes(list(data)))


@pytest.mark.parametrize(
    "made",
    [
        lambda values: values,
        lambda values: numpy.array(values),
        lambda values: numpy.array(values, numpy.float32),
        lambda values: numpy.array(values, ">f8"),
    ],
)
def test_a_list_of_numbers_may_be_an_array(made: Callable[[list[float]], Any]) -> None:
    values = [0.5, -1.0, math.inf, -math.inf, math.nan, 2**24]
    data = JAZZY.decode(REALS, JAZZY.encode(REALS, {**LAYOUT, "data": made(values)})).data
    assert numpy.array_equal(data, values, equal_nan=True)


def test_a_number_may_be_numpys() -> None:
    for value in (numpy.float32(0.5), numpy.float64(0.5), 0.5):
        assert JAZZY.encode("std_msgs/msg/Float64", {"data": value})[-1] == 0x3F
    assert JAZZY.encode("std_msgs/msg/Bool", {"data": numpy.bool_(True)}) == b"\0\1\0\0\1"


def test_a_very_long_list_is_sent_whole() -> None:
    values = numpy.arange(3_000_000, dtype=numpy.float32)
    payload = JAZZY.encode(REALS, {**LAYOUT, "data": values})
    assert len(payload) == 4 + 4 + 4 + 4 + 12_000_000
    assert numpy.array_equal(JAZZY.decode(REALS, payload).data, values)
    text = "é" * 1_000_000
    assert (
        JAZZY.decode("std_msgs/msg/String", JAZZY.encode("std_msgs/msg/String", {"data": text})).data
        == text
    )


def test_a_wstring_has_four_bytes_for_each_unit() -> None:
    name = "example_interfaces/msg/WString"
    payload = b"\0\1\0\0\3\0\0\0\xe4\0\0\0\x3e\xd8\0\0\x16\xdd\0\0"
    assert JAZZY.encode(name, {"data": "ä🤖"}) == payload
    assert JAZZY.decode(name, payload).data == "ä🤖"
    assert JAZZY.decode(name, b"\0\0\0\0\0\0\0\1\0\0\0\x41").data == "A"


@pytest.mark.parametrize(
    "units",
    [b"\1\0\0\0\x3e\xd8\0\0", b"\1\0\0\0\0\0\1\0", b"\2\0\0\0\x41\0\0\0", b"\xff\xff\xff\xff", b""],
    ids=["half a pair", "beyond UTF-16", "cut off", "too many", "nothing"],
)
def test_a_broken_wstring_is_not_a_message(units: bytes) -> None:
    with pytest.raises(DecodeError):
        JAZZY.decode("example_interfaces/msg/WString", b"\0\1\0\0" + units)


def test_a_byte_has_all_of_its_values() -> None:
    for value in range(256):
        payload = JAZZY.encode("std_msgs/msg/Byte", {"data": value})
        assert payload == bytes((0, 1, 0, 0, value))
        assert JAZZY.decode("std_msgs/msg/Byte", payload).data == value


@pytest.mark.parametrize(
    ("value", "plain"),
    [
        (2**53, 2**53),
        (2**53 + 1, "9007199254740993"),
        (-(2**53) - 1, "-9007199254740993"),
        (2**64 - 1, "18446744073709551615"),
        (math.nan, "NaN"),
        (math.inf, "Infinity"),
        (-math.inf, "-Infinity"),
        (-0.5, -0.5),
        (True, True),
        (None, None),
        ("text", "text"),
        (b"\0\xff", [0, 255]),
        (memoryview(array("Q", [1, 2**63])), [1, "9223372036854775808"]),
        (memoryview(array("f", [1.5, math.nan])), [1.5, "NaN"]),
        (memoryview(b"\0\xff"), [0, 255]),
        ([], []),
    ],
)
def test_browser_gets_only_values_that_json_has(value: Any, plain: Any) -> None:
    assert to_plain(value) == plain
    json.dumps(to_plain(value), allow_nan=False)


def test_a_message_becomes_a_table_of_its_fields(cell: Interfaces, good: dict[str, Any]) -> None:
    plain = to_plain(cell.decode(EVERYTHING, cell.encode(EVERYTHING, good)))
    assert list(plain) == [field.name for field in cell.structures[EVERYTHING].fields]
    assert plain["nothing"] == {}
    assert plain["high"] == str(2**64 - 1)
    assert plain["times"][0] == {"sec": 2**31 - 1, "nanosec": 2**32 - 1}


def test_constants_are_no_fields() -> None:
    status = JAZZY.decode("action_msgs/msg/GoalStatus", b"\0\1\0\0" + bytes(25))
    assert set(to_plain(status)) == {"goal_info", "status"}
    assert status.STATUS_SUCCEEDED == 4


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("steps[2]", 127),
        ("at[0]", 1.7976931348623157e308),
        ("times[1].sec", 2**31 - 1),
        ("words[0]", "x" * 300),
        ("titles[1]", "x" * 300),
        ("on", True),
    ],
)
def test_a_value_is_found_at_its_path(
    cell: Interfaces, good: dict[str, Any], path: str, value: Any
) -> None:
    value_read = cell.field_reader(EVERYTHING, [path]).read(cell.encode(EVERYTHING, good)).get(path)
    assert value_read == value
    assert type(value_read) is type(value)


def test_a_list_that_is_too_short_has_no_value_there(cell: Interfaces, good: dict[str, Any]) -> None:
    payload = cell.encode(EVERYTHING, {**good, "words": ["a"]})
    values = cell.field_reader(EVERYTHING, ["words[0]", "words[1]"]).read(payload)
    assert (values.get("words[0]"), values.get("words[1]")) == ("a", None)


@pytest.mark.parametrize(
    ("path", "written"),
    [
        ("words[99]", "string"),
        ("at[2]", "float64"),
        ("times[0]", "builtin_interfaces/msg/Time"),
        ("times[1].sec", "int32"),
        ("titles", "wstring[<=2]"),
    ],
)
def test_a_path_goes_into_lists(cell: Interfaces, path: str, written: str) -> None:
    assert cell.field_type(EVERYTHING, path) == written


@pytest.mark.parametrize(
    ("path", "why"),
    [
        ("at[3]", r'no \[3\] \(in "at\[3\]"\): float64\[3\] ends with \[2\]'),
        ("titles[2]", r"wstring\[<=2\] ends with \[1\]"),
        ("on[0]", r"bool is not a list"),
        ("at[0][0]", r"float64 is not a list"),
        ("times.sec", r'no "sec" .*Time\[2\] has no fields of its own'),
        ("at[-1]", "is not a field: it must be like"),
        ("at[", "is not a field: it must be like"),
        ("at[x]", "is not a field: it must be like"),
        ("[0]", "is not a field: it must be like"),
    ],
)
def test_a_path_that_leads_nowhere_is_refused(cell: Interfaces, path: str, why: str) -> None:
    with pytest.raises(InterfaceError, match=why):
        cell.field_type(EVERYTHING, path)


def test_truncated_message_is_refused(cell: Interfaces) -> None:
    whole = cell.encode(EVERYTHING, Samples(cell.structures, 3).fields(EVERYTHING))
    for length in range(len(whole) - 3):
        with pytest.raises(DecodeError):
            cell.decode(EVERYTHING, whole[:length])


def test_damage_raises_nothing_but_a_decode_error(cell: Interfaces) -> None:
    """Every byte of a good message replaced in turn, and garbage for many types."""
    whole = cell.encode(EVERYTHING, Samples(cell.structures, 3).fields(EVERYTHING, "most"))
    for at in range(len(whole)):
        for byte in (0, 1, 0x7F, 0xFF)[at % several(4, 1) :: several(4, 1)]:
            decoded(cell, EVERYTHING, whole[:at] + bytes((byte,)) + whole[at + 1 :])
    for seed, name in list(enumerate(cell.structures))[:: several(4, 1)]:
        for data in garbage(seed):
            decoded(cell, name, data)


def decoded(interfaces: Interfaces, name: str, data: bytes) -> None:
    """Whatever is read can be shown."""
    try:
        message = interfaces.decode(name, data)
    except DecodeError:
        return
    json.dumps(to_plain(message), allow_nan=False)


@pytest.mark.parametrize("distro", DISTROS if LONG else ("humble", "rolling"))
def test_all_that_is_built_in_comes_back_as_it_went(
    distro: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(codec, "MAX_ELEMENTS", 10**6)  # of a message that is read whole
    interfaces = load_interfaces(distro)
    for name in interfaces.structures:
        for edge in ("least", "most"):
            fields = Samples(interfaces.structures).fields(name, edge)
            plain = to_plain(interfaces.decode(name, interfaces.encode(name, fields)))
            assert plain == to_plain_fields(fields), name


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (True, "true"),
        (None, "null"),
        (-0.5, "-0.5"),
        (math.nan, "nan"),
        (5, "5"),
        ("fast", '"fast"'),
        ('a "b" \\', '"a \\"b\\" \\\\"'),
        ("\U000e0041", '"\\U000e0041"'),
        ("a\n\0\u202e\ud800é漢", '"a\\u000a\\u0000\\u202e\\ud800é漢"'),
        ("x" * 100, f'"{"x" * 60}…"'),
        (date(2026, 1, 2), "2026-01-02"),
        (datetime(2026, 1, 2, 3, 4, 5), "2026-01-02T03:04:05"),
        (clock(3, 4), "03:04:00"),
        ([], "[]"),
        ([1, "a", True, 4], '[1, "a", true, …]'),
        ({"x": 0, "y": {"z": "far"}}, '{x = 0, y = {z = "far"}}'),
        ({"x": [[["deep"]]]}, "{x = [[…]]}"),
        (["x" * 100] * 2, f'["{"x" * 59}…]'),
        (10**400, "100000000000000000...0000000000000000000"),
    ],
)
def test_a_value_is_shown_as_files_and_requests_have_it(value: Any, text: str) -> None:
    assert format_value(value) == text

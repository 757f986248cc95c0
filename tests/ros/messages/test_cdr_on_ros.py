"""The codec against ROS 2's own: every interface of the installed ROS packages, both ways.

Definitions come twice: from the packages' own files, as a robot's would, and built in.
"""

import base64
import json
import tempfile
from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any, Final

import pytest

from app.ros.cdr import codec
from app.ros.messages import load_interfaces, to_plain
from app.ros.messages.packages import read_folders
from tests.support.form import several
from tests.support.parts import ROS_PYTHON, TESTS
from tests.support.processes.commanded import Commanded
from tests.support.samples import Edge, Samples

pytestmark = [pytest.mark.usefixtures("ros"), pytest.mark.promise("values")]

SHARE: Final = ROS_PYTHON.parent.parent / "share"
FOLDERS: Final = [SHARE] if SHARE.exists() else []  # without ROS the tests can be collected
DISTRO: Final = "kilted"  # that of tests/ros_nodes/requirements.lock
RANDOM: Final[tuple[Edge, ...]] = ("random",)
EDGES: Final = ("least", "most", *(RANDOM * several(1, 3)))

OF_ROBOT: Final = load_interfaces(DISTRO, FOLDERS)
BUILT_IN: Final = load_interfaces(DISTRO)
TYPES: Final = tuple(read_folders(FOLDERS).structures)
PACKAGES: Final = sorted({name.partition("/")[0] for name in TYPES})
# These have no .msg file, only an .idl one, which is not read.
ONLY_IDL: Final = {
    f"test_msgs/msg/{name}"
    for name in ("ComplexNestedKey", "KeyedLong", "KeyedString", "NonKeyedWithNestedKey")
}


class RosCodec(Commanded):
    """`tests/ros_nodes/codec.py` in its own environment."""

    def __init__(self) -> None:
        super().__init__(
            [ROS_PYTHON, TESTS / "ros_nodes/codec.py"],
            {
                "ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF",
                "RMW_IMPLEMENTATION": "rmw_fastrtps_cpp",
                "ROS_LOG_DIR": tempfile.gettempdir(),
            },
        )

    def encode(self, type_name: str, fields: Mapping[str, Any]) -> bytes:
        return base64.b64decode(self("encode", type=type_name, fields=fields))

    def decode(self, type_name: str, data: bytes) -> Any:
        return self("decode", type=type_name, data=base64.b64encode(data).decode())


@pytest.fixture(scope="module")
def ros() -> Iterator[RosCodec]:
    codec = RosCodec()
    yield codec
    codec.end()


@cache
def hashes_of_ros() -> Mapping[str, str]:
    """What the packages' type descriptions say, services and actions too."""
    hashes: dict[str, str] = {}
    for file in SHARE.glob("*/*/*.json"):
        for type_hash in json.loads(file.read_text()).get("type_hashes", ()):
            hashes[type_hash["type_name"]] = type_hash["hash_string"]
    return hashes


def same(value: Any, other: Any) -> bool:
    """Equal, not-a-number to itself too."""
    return json.dumps(value, sort_keys=True) == json.dumps(other, sort_keys=True)


def plain(fields: Any) -> Any:
    """Fields as they were given, in the form of `to_plain`."""
    if isinstance(fields, Mapping):
        return {name: plain(value) for name, value in fields.items()}
    return [plain(field) for field in fields] if isinstance(fields, list) else to_plain(fields)


def cut(data: bytes, like: bytes) -> bytes:
    """Without what ROS's serializer leaves after a message: it makes room before it knows."""
    return data[: len(like) + -len(like) % 4]


def test_the_installed_packages_are_those_that_count() -> None:
    assert set(PACKAGES) >= {
        "action_msgs",
        "builtin_interfaces",
        "diagnostic_msgs",
        "geometry_msgs",
        "lifecycle_msgs",
        "nav_msgs",
        "rcl_interfaces",
        "sensor_msgs",
        "std_msgs",
        "std_srvs",
        "test_msgs",
        "trajectory_msgs",
    }
    assert len(TYPES) >= 250


def types_of(package: str) -> list[str]:
    return [name for name in TYPES if name.startswith(f"{package}/")]


@pytest.mark.parametrize("package", PACKAGES)
def test_codec_and_ros_read_and_write_the_same_bytes(ros: RosCodec, package: str) -> None:
    for type_name in types_of(package):
        samples = Samples(OF_ROBOT.structures, seed=sum(type_name.encode()))
        for edge in EDGES:
            fields = samples.fields(type_name, edge)
            ours = OF_ROBOT.encode(type_name, fields)
            assert same(ros.decode(type_name, ours), fields), type_name
            theirs = cut(ros.encode(type_name, fields), ours)
            assert len(ours) <= len(theirs) <= len(ours) + 3, type_name
            # Between the values ROS leaves whatever was in its memory.
            pairs = zip(ours, theirs, strict=False)
            assert all(result in (0, other) for result, other in pairs), type_name
            assert same(to_plain(OF_ROBOT.decode(type_name, theirs)), plain(fields)), type_name


def test_ros_reads_and_writes_long_lists_and_texts_too(
    ros: RosCodec, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(codec, "MAX_ELEMENTS", 10**6)  # of a message that is read whole
    name = "test_msgs/msg/UnboundedSequences"
    fields = Samples(OF_ROBOT.structures).fields(name, "most")
    long = {n: v * several(400, 2000) for n, v in fields.items() if isinstance(v, list)}
    long["uint8_values"] = [n % 256 for n in range(300_001)]
    long["string_values"] = ["", "é" * 1_000_000]
    data = OF_ROBOT.encode(name, {**fields, **long})
    assert same(ros.decode(name, data), {**fields, **long})
    theirs = cut(ros.encode(name, {**fields, **long}), data)
    assert same(to_plain(OF_ROBOT.decode(name, theirs)), plain({**fields, **long}))


def test_built_in_definitions_equal_the_robots() -> None:
    both = BUILT_IN.structures.keys() & set(TYPES)
    assert len(both) > 150
    for type_name in both:
        assert BUILT_IN.structures[type_name] == OF_ROBOT.structures[type_name], type_name


def test_type_hashes_are_those_of_the_packages() -> None:
    """Messages, parts, services and actions: as rosidl computed them when the packages were built."""
    known = {name: value for name, value in hashes_of_ros().items() if name not in ONLY_IDL}
    assert len(known) > 280
    assert {name: OF_ROBOT.type_hash(name) for name in known} == known
    built_in = [name for name in known if not name.startswith("test_msgs/")]
    assert {name: BUILT_IN.type_hash(name) for name in built_in} == {n: known[n] for n in built_in}


def test_type_hashes_are_those_of_publishers(ros: RosCodec) -> None:
    messages = [name for name in TYPES if "/msg/" in name]
    assert ros("hashes", types=messages) == {name: OF_ROBOT.type_hash(name) for name in messages}


@pytest.mark.parametrize("package", PACKAGES)
def test_constants_and_defaults_are_those_of_ros(ros: RosCodec, package: str) -> None:
    for type_name in types_of(package):
        described = ros("describe", type=type_name)
        assert same(dict(OF_ROBOT.constants(type_name)), described["constants"]), type_name
        left_out = ros.decode(type_name, OF_ROBOT.encode(type_name, {}))
        assert same(left_out, described["defaults"]), type_name

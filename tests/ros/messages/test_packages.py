"""Interfaces from files: what is taken, and what is refused with its file, line and field."""

import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest

from app.ros.messages import DISTROS, Interfaces, load_interfaces
from app.ros.messages.definitions import Type
from app.ros.messages.distributions import BUILTIN
from app.ros.messages.packages import file_stamps, package_files, read_folders
from app.system.errors import FieldError, InterfaceError

Make = Callable[[Mapping[str, str]], Path]

CELL = {
    "cell_msgs/msg/Tool.msg": """
        # What is in the gripper's place.
        uint8 GRIPPER=0
        uint8 CAMERA = 1   # with a lamp
        string MAKER="A & B # C"
        string PLAIN=not quoted  # and why
        float64 HALF=.5
        byte MASK=0x7f
        bool FITTED=True
        string<=8 name
        uint8 kind 1       # a camera
        float32[3] offset [0.5, -1, 1e3]
        string[<=2] tags ["a, b", 'it\\'s']
        Wear[] wear
        geometry_msgs/Pose at
    """,
    "cell_msgs/msg/Wear.msg": "builtin_interfaces/Time since\nint64 count 0\n",
    "cell_msgs/srv/Change.srv": "Tool tool\n---\nbool ok\nstring why\n",
    "cell_msgs/action/Weld.action": "Tool tool\n---\nint32 spots\n---\nfloat32 progress\n",
}


@pytest.fixture
def make(tmp_path: Path) -> Make:
    """Writes files of packages into a folder."""

    def made(files: Mapping[str, str]) -> Path:
        for name, text in files.items():
            path = tmp_path / "share" / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text("\n".join(line.strip() for line in text.splitlines()))
        return tmp_path / "share"

    return made


def test_a_package_brings_messages_services_and_actions(make: Make) -> None:
    cell = Interfaces("jazzy", [make(CELL)])
    assert [str(field.type) for field in cell.structures["cell_msgs/msg/Tool"].fields] == [
        "string<=8",
        "uint8",
        "float32[3]",
        "string[<=2]",
        "cell_msgs/msg/Wear[]",
        "geometry_msgs/msg/Pose",
    ]
    assert cell.service_types("cell_msgs/srv/Change") == (
        "cell_msgs/srv/Change_Request",
        "cell_msgs/srv/Change_Response",
    )
    weld = cell.action_types("cell_msgs/action/Weld")
    assert cell.field_type(weld.send_goal_request, "goal_id.uuid[15]") == "uint8"
    assert cell.field_type(weld.send_goal_request, "goal.tool.offset[2]") == "float32"
    assert cell.field_type(weld.send_goal_response, "stamp.nanosec") == "uint32"
    assert cell.field_type(weld.get_result_request, "goal_id") == "unique_identifier_msgs/msg/UUID"
    assert cell.field_type(weld.get_result_response, "status") == "int8"
    assert cell.field_type(weld.get_result_response, "result.spots") == "int32"
    assert cell.field_type(weld.feedback_message, "feedback.progress") == "float32"
    assert cell.service_types(weld.send_goal) == (weld.send_goal_request, weld.send_goal_response)
    assert cell.service_types(weld.cancel_goal) == (
        f"{weld.cancel_goal}_Request",
        f"{weld.cancel_goal}_Response",
    )
    cell.require(weld.status)


def test_constants_are_there_with_their_values(make: Make) -> None:
    assert Interfaces("jazzy", [make(CELL)]).constants("cell_msgs/msg/Tool") == {
        "GRIPPER": 0,
        "CAMERA": 1,
        "MAKER": "A & B # C",
        "PLAIN": "not quoted",
        "HALF": 0.5,
        "MASK": 127,
        "FITTED": True,
    }


def test_omitted_field_gets_its_default(make: Make) -> None:
    cell = Interfaces("jazzy", [make(CELL)])
    tool = "cell_msgs/msg/Tool"
    decoded = cell.decode(tool, cell.encode(tool, {"wear": [{}]}))
    assert (decoded.name, decoded.wear[0].since.sec, decoded.wear[0].count) == ("", 0, 0)
    assert (decoded.kind, decoded.offset.tolist()) == (1, [0.5, -1.0, 1000.0])
    assert decoded.tags == ["a, b", "it's"]
    assert decoded.at.orientation.w == 1.0
    with pytest.raises(FieldError, match=r"wear\[0\].sinc: unknown field"):
        cell.encode(tool, {"wear": [{"sinc": {}}]})


@pytest.mark.parametrize(
    "place", ["", "cell_msgs", "..", "../install"], ids=["share", "package", "above", "colcon"]
)
def test_a_folder_may_be_a_package_or_have_packages(make: Make, tmp_path: Path, place: str) -> None:
    folder = make(CELL)
    if place == "../install":
        (tmp_path / "install/cell_msgs").mkdir(parents=True)
        os.symlink(folder, tmp_path / "install/cell_msgs/share")
    Interfaces("jazzy", [folder / place]).require("cell_msgs/msg/Tool")


def test_a_package_is_named_by_its_package_xml(make: Make) -> None:
    folder = make({"cell/msg/Lamp.msg": "bool on", "cell/package.xml": "<name> cell_msgs </name>"})
    Interfaces("jazzy", [folder]).require("cell_msgs/msg/Lamp")


PACKAGE_XML = "<package><name>cell_msgs</name></package>"


@pytest.mark.parametrize(
    "file",
    [
        "cell_msgs/arm/Move.srv",  # as rosidl installs srv/arm/Move.srv
        "cell_msgs/srv/arm/Move.srv",
        "cell_msgs/operation_mode/srv/Move.srv",
        "cell_msgs/arm/left/srv/Move.srv",
    ],
)
@pytest.mark.parametrize("place", ["", "cell_msgs"])
def test_an_interface_may_be_in_any_folder_of_its_package(make: Make, file: str, place: str) -> None:
    folder = make(
        {file: "uint8 mode\n---\nbool ok", "cell_msgs/package.xml": PACKAGE_XML, "std/msg/A.msg": ""}
    )
    cell = Interfaces("jazzy", [folder / place])
    cell.service_types("cell_msgs/srv/Move")
    assert not [name for name in cell.structures if name.startswith("operation_mode/")]
    assert any(file in str(path) for path, *_ in file_stamps([folder]))
    assert [path for path in package_files(folder) if path.suffix == ".srv"] == [folder / file]


def test_file_in_the_usual_folder_overrides_another_of_its_type(make: Make) -> None:
    files = {"cell_msgs/msg/A.msg": "int8 a", "cell_msgs/test/A.msg": "int8 b"}
    folder = make(files | {"cell_msgs/package.xml": PACKAGE_XML, "other/test/A.msg": "int8 c"})
    assert Interfaces("jazzy", [folder]).field_type("cell_msgs/msg/A", "a") == "int8"


def test_file_outside_a_package_is_named_with_the_remedy(make: Make) -> None:
    folder = make({"cell_msgs/arm/Move.srv": "---\n", "cell_msgs/modes/msg/A.msg": "", **CELL})
    cell = Interfaces("jazzy", [folder])
    for ask, name, file in (
        (cell.service_types, "cell_msgs/srv/Move", "cell_msgs/arm/Move.srv"),
        (Interfaces("jazzy", [folder / "cell_msgs/modes"]).require, "cell_msgs/msg/A", "msg/A.msg"),
    ):
        why = f'"{name}" is not there: .*{file} is not read as this type: its package needs a package'
        with pytest.raises(InterfaceError, match=why):
            ask(name)


def test_packages_may_need_each_other_in_any_order(make: Make) -> None:
    folder = make({"a/msg/A.msg": "b/B b", "b/msg/B.msg": "c/msg/C[2] c", "c/msg/C.msg": "wstring c"})
    both = Interfaces("jazzy", [folder / "a", folder / "c", folder / "b"])
    fields = {"b": {"c": [{"c": "ä🤖"}, {"c": ""}]}}
    decoded = both.decode("a/msg/A", both.encode("a/msg/A", fields))
    assert [element.c for element in decoded.b.c] == ["ä🤖", ""]


def test_definition_from_files_overrides_the_built_in(make: Make) -> None:
    folder = make({"std_msgs/msg/Bool.msg": "bool data\nbool sure"})
    assert Interfaces("jazzy", [folder]).field_type("std_msgs/msg/Bool", "sure") == "bool"
    assert load_interfaces("jazzy").encode("std_msgs/msg/Bool", {"data": True}) == b"\0\1\0\0\1"


def test_a_field_may_have_a_name_that_python_keeps_for_itself(make: Make) -> None:
    name = "cell_msgs/msg/Step"
    step = Interfaces("jazzy", [make({f"{name}.msg": "int8 from\nint8 lambda\nint8 self\nint8 cls"})])
    fields = {"from": 1, "lambda": 2, "self": 3, "cls": 4}
    payload = step.encode(name, fields)
    assert payload == b"\0\1\0\0\1\2\3\4"
    assert step.decode(name, payload).from_ == 1


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("int32", "is not"),
        ("int32 = 5", "is not"),
        ("int33 x", '"int33" is not a type'),
        ("octet x", '"octet" is not a type'),
        ("a/b/c/D x", "is not a type"),
        ("int32[0] x", "1 element at least"),
        ("int32[<=] x", "how many at most"),
        ("int32[-1] x", "is not a type"),
        ("int32<=5 x", "only a string has a bound"),
        ("string<=0 x", "of 1 at least"),
        ("int32 X", "is not a field's name"),
        ("int32 x_", "is not a field's name"),
        ("int32 x__y", "is not a field's name"),
        ("int32 1x", "is not a field's name"),
        ("int32 x=5", "is not a constant's name"),
        ("int32 X=", "nothing is not a value of int32"),
        ("int32 X=five", "five is not a value of int32"),
        ("uint8 X=256", "256: 256 is out of range: uint8 goes from 0 to 255"),
        ("int8 x -129", "out of range"),
        ("bool x yes", "yes is not a value of bool"),
        ("float32 x 1e39", "out of range"),
        ("float64 x 1,5", "is not a value"),
        ("string<=2 x 'abc'", "is 3 bytes long"),
        ("int32[2] x [1]", "needs 2 elements, not 1"),
        ("int32[<=2] x [1,2,3]", "takes 2 elements at most, not 3"),
        ("int32[2] x 1, 2", "is not a list"),
        ("int32[] x [1,,2]", "commas"),
        ("Wear x 5", "takes no default"),
        ("Wear X=5", "a constant is of a base type"),
        ("int32[2] X=[1,2]", "a constant is of a base type"),
        ("int32 kind", '"kind" is there twice'),
    ],
)
def test_a_line_that_is_wrong_is_named(make: Make, line: str, why: str) -> None:
    files = {
        "cell_msgs/msg/Wear.msg": "int8 a",
        "cell_msgs/msg/Bad.msg": f"# Bad\nuint8 kind\n{line}\n",
    }
    cell = Interfaces("jazzy", [make(files)])
    cell.require("cell_msgs/msg/Wear")
    assert list(cell.unusable) == ["cell_msgs/msg/Bad"]
    with pytest.raises(InterfaceError, match=why) as caught:
        cell.require("cell_msgs/msg/Bad")
    assert str(caught.value).startswith('"cell_msgs/msg/Bad" can\'t be used: /')
    assert f"{Path('cell_msgs/msg/Bad.msg')}:3: " in str(caught.value)
    assert caught.value.source is not None
    assert caught.value.source.name == "Bad.msg"


@pytest.mark.parametrize(
    ("files", "why"),
    [
        ({"m/srv/S.srv": "int8 a"}, 'S.srv: has 0 "---" lines; a .srv file has 1'),
        ({"m/action/S.action": "---"}, "a .action file has 2"),
        ({"m/msg/S.msg": "int8 a\n---\nint8 b"}, "a .msg file has 0"),
        ({"m/msg/small.msg": ""}, "is not an interface name"),
        ({"M/msg/Small.msg": ""}, "is not a package name"),
        ({"m/msg/A.msg": "Lost x"}, 'A.msg: field "x" is of type m/msg/Lost, which is not there'),
        ({"m/msg/A.msg": "std_msgs/Strin x"}, "did you mean std_msgs/msg/String"),
        ({"m/srv/A.srv": "---\nlost_msgs/B x"}, 'field "x" is of type lost_msgs/msg/B'),
        ({"m/msg/A.msg": "B b", "m/msg/B.msg": "A[] a"}, "contains itself"),
        ({"m/msg/A.msg": "A[] a"}, "contains itself"),
    ],
)
def test_files_that_do_not_fit_together_are_named(
    make: Make, files: Mapping[str, str], why: str
) -> None:
    every = Interfaces("jazzy", [make(files)])
    assert why in str(every.unusable[next(iter(every.unusable))])
    for file in files:
        name = file.rpartition(".")[0]
        with pytest.raises(InterfaceError) as caught:
            every.require(f"{name}_Request" if "/srv/" in name else name)
        assert why in str(caught.value)
    assert load_interfaces("jazzy").structures.items() <= every.structures.items()


def test_interfaces_that_need_a_faulty_file_are_left_out(make: Make) -> None:
    files = {
        **CELL,
        "cell_msgs/msg/Wear.msg": "int33 since",  # Tool needs it, and whatever needs that
        "cell_msgs/msg/Lamp.msg": "bool on",
        "cell_msgs/srv/Light.srv": "Lamp lamp\n---\nbool ok\n",
    }
    cell = Interfaces("jazzy", [make(files)])
    assert set(cell.unusable) == {
        "cell_msgs/msg/Wear", "cell_msgs/msg/Tool", "cell_msgs/srv/Change", "cell_msgs/action/Weld",
    }  # fmt: skip
    cell.require("cell_msgs/msg/Lamp")
    cell.service_types("cell_msgs/srv/Light")
    assert cell.type_hash("cell_msgs/srv/Light").startswith("RIHS01_")
    for ask, name in (
        (cell.require, "cell_msgs/msg/Tool"),
        (cell.service_types, "cell_msgs/srv/Change"),
        (cell.action_types, "cell_msgs/action/Weld"),
        (cell.require, "cell_msgs/action/Weld_SendGoal_Request"),
        (cell.type_hash, "cell_msgs/action/Weld"),
    ):
        with pytest.raises(InterfaceError) as caught:
            ask(name)
        assert str(caught.value).startswith(f'"{name}" can\'t be used: ')
        assert str(caught.value).endswith(
            'Wear.msg:1: "int33" is not a type: a base type, Name, or package/Name'
        )
        assert caught.value.source is not None
        assert caught.value.source.name == "Wear.msg"
    with pytest.raises(InterfaceError, match=r"did you mean cell_msgs/msg/Tool"):
        cell.require("cell_msgs/msg/Tol")


def test_a_file_with_a_fault_hides_the_built_in_type_of_its_name(make: Make) -> None:
    """The robot has another one than the distribution: no one knows which."""
    cell = Interfaces("jazzy", [make({"std_msgs/msg/Header.msg": "int33 x"})])
    for name in ("std_msgs/msg/Header", "sensor_msgs/msg/Imu", "nav_msgs/srv/GetPlan_Request"):
        with pytest.raises(InterfaceError, match=r"Header\.msg:1: "):
            cell.require(name)
    cell.require("std_msgs/msg/Bool")


def test_a_folder_without_interfaces_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InterfaceError, match="has no interfaces: they must be in"):
        Interfaces("jazzy", [tmp_path])


def test_interface_with_only_an_idl_file_is_named_with_the_remedy(make: Make) -> None:
    folder = make(
        {
            "cell_msgs/msg/Lamp.msg": "bool on",
            "cell_msgs/msg/Lamp.idl": "module cell_msgs {};",
            "cell_msgs/msg/Doors.idl": "module cell_msgs {};",
            "cell_msgs/srv/Change.idl": "module cell_msgs {};",
            "cell_msgs/action/Weld.idl": "module cell_msgs {};",
        }
    )
    cell = Interfaces("jazzy", [folder])
    cell.require("cell_msgs/msg/Lamp")
    for ask, name in (
        (cell.require, "cell_msgs/msg/Doors"),
        (cell.service_types, "cell_msgs/srv/Change"),
        (cell.action_types, "cell_msgs/action/Weld"),
    ):
        _, kind, stem = name.split("/")
        why = (
            f'"{name}" is not there: {folder / name}.idl is not read, as no .idl is: put {stem}.{kind}'
        )
        with pytest.raises(InterfaceError) as caught:
            ask(name)
        assert str(caught.value) == f"{why} beside it"


def test_interface_that_needs_an_idl_only_interface_is_named(make: Make) -> None:
    folder = make({"a/msg/A.msg": "b/B b", "b/msg/B.idl": "module b {};"})
    with pytest.raises(InterfaceError) as caught:
        Interfaces("jazzy", [folder]).require("a/msg/A")
    assert f'{folder / "a/msg/A.msg"}: field "b" is of type b/msg/B, which is not there: ' in str(
        caught.value
    )
    assert str(caught.value).endswith("b/msg/B.idl is not read, as no .idl is: put B.msg beside it")


def test_folder_with_only_idl_files_is_refused_with_the_remedy(make: Make) -> None:
    folder = make({"b/srv/B.idl": "module b {};"})
    with pytest.raises(InterfaceError, match=r"has no interfaces: .*B\.idl is not read.* put B\.srv"):
        Interfaces("jazzy", [folder])


def test_a_file_that_is_no_text_is_refused(make: Make) -> None:
    folder = make(CELL)
    (folder / "cell_msgs/msg/Bad.msg").write_bytes(b"int8 \xff")
    with pytest.raises(InterfaceError, match=r"Bad\.msg can't be read: it is not UTF-8"):
        Interfaces("jazzy", [folder]).require("cell_msgs/msg/Bad")


def test_two_folders_must_not_differ_in_a_type(make: Make, tmp_path: Path) -> None:
    other = tmp_path / "other/cell_msgs/msg"
    other.mkdir(parents=True)
    (other / "Wear.msg").write_text("builtin_interfaces/Time since\nint64 count 0")
    folders = [make(CELL), tmp_path / "other"]
    Interfaces("jazzy", folders)
    (other / "Wear.msg").write_text("int64 count")
    differ = Interfaces("jazzy", [*folders, folders[0]])
    with pytest.raises(
        InterfaceError, match=r"cell_msgs/msg/Wear is defined here and, differently, in"
    ):
        differ.require("cell_msgs/msg/Wear")


def test_a_changed_file_is_read_again(make: Make) -> None:
    folder = make(CELL)
    before = load_interfaces("jazzy", (folder,))
    assert load_interfaces("jazzy", [folder]) is before
    (folder / "cell_msgs/msg/Wear.msg").write_text("int64 count 0\nint8 hours")
    assert load_interfaces("jazzy", (folder,)).field_type("cell_msgs/msg/Wear", "hours") == "int8"


@pytest.mark.parametrize("distro", list(DISTROS))
def test_common_command_types_are_built_in(distro: str) -> None:
    here = load_interfaces(distro)
    for service in (
        "std_srvs/srv/SetBool",
        "std_srvs/srv/Trigger",
        "rcl_interfaces/srv/SetParameters",
        "lifecycle_msgs/srv/ChangeState",
        "action_msgs/srv/CancelGoal",
        "example_interfaces/srv/AddTwoInts",
        "example_interfaces/action/Fibonacci_SendGoal",
    ):
        assert here.service_types(service) == (f"{service}_Request", f"{service}_Response")
    assert here.action_types("example_interfaces/action/Fibonacci").status in here.structures
    assert here.constants("action_msgs/srv/CancelGoal_Response")["ERROR_REJECTED"] == 1


def test_each_distribution_has_all_of_the_built_in_that_it_can() -> None:
    """Only what needs messages of a later one is left out, and before iron there are no events."""
    every = set(read_folders([BUILTIN]).structures)
    missing = {distro: every - set(load_interfaces(distro).structures) for distro in DISTROS}
    assert {name.rpartition("_")[0] for name in missing["humble"] if "_Event" not in name} == {
        "rcl_interfaces/srv/GetLoggerLevels",
        "rcl_interfaces/srv/SetLoggerLevels",
        "type_description_interfaces/srv/GetTypeDescription",
    }
    assert {distro for distro in DISTROS if missing[distro]} == {"humble"}


def test_humble_has_services_without_hashes() -> None:
    humble = load_interfaces("humble")
    assert humble.type_hash("std_srvs/srv/SetBool_Request").startswith("RIHS01_")
    for name in ("std_srvs/srv/SetBool", "example_interfaces/action/Fibonacci"):
        with pytest.raises(InterfaceError, match=f'"{name}" is not a type with a hash'):
            humble.type_hash(name)


@pytest.mark.parametrize(
    ("ask", "name", "why"),
    [
        (
            "service_types",
            "std_srvs/srv/SetBol",
            "is not a service of ROS 2 jazzy; did you mean std_srvs/srv/SetBool",
        ),
        ("service_types", "std_msgs/msg/Bool", "is not a service"),
        (
            "action_types",
            "example_interfaces/action/Fibonaci",
            "did you mean example_interfaces/action/Fibonacci",
        ),
        ("action_types", "std_srvs/srv/SetBool", "is not an action"),
        ("constants", "std_msgs/msg/Bol", "is not an interface"),
        ("type_hash", "std_msgs/msg/Bol", "is not"),
    ],
)
def test_an_unknown_name_is_refused_with_the_nearest(ask: str, name: str, why: str) -> None:
    with pytest.raises(InterfaceError) as caught:
        getattr(load_interfaces("jazzy"), ask)(name)
    assert why in str(caught.value)


@pytest.mark.parametrize(
    ("name", "digest"),
    [
        ("std_srvs/srv/SetBool", "abe9e4bb6b41b40e6789712c00ec8871923e089af3f667a79992a428cff2da0a"),
        (
            "action_msgs/srv/CancelGoal",
            "573d8b0a534451d7bc2ac8c5ffde8ac14b8593b7001175d0cd6516dcbeb8689a",
        ),
        ("std_msgs/msg/Char", "3ad2d04dd29ba19d04b16659afa3ccaedd691914b02a64e82e252f2fa6a586a9"),
    ],
)
def test_type_hashes_are_those_of_the_packages_descriptions(name: str, digest: str) -> None:
    assert load_interfaces("jazzy").type_hash(name) == f"RIHS01_{digest}"


def test_a_type_is_written_as_in_a_file() -> None:
    kinds: list[tuple[Any, str]] = [
        (Type("string", bound=8, container="sequence"), "string<=8[]"),
        (Type("int8", container="sequence", size=3), "int8[<=3]"),
        (Type("std_msgs/msg/Header", container="array", size=2), "std_msgs/msg/Header[2]"),
    ]
    for kind, written in kinds:
        assert str(kind) == written

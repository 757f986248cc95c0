"""Paths to elements by a sibling's value: how they are written, what is wrong, what they show."""

import asyncio
from pathlib import Path
from typing import Any, Final

import pytest

from app.cell.commands.confirmations import Confirmations
from app.cell.commands.services import with_fields
from app.cell.permission.interlocks import interlock_verdict
from app.cell.robot.state import RobotState, Sample
from app.cell.view.view import build_view
from app.panel import load_panel
from app.panel.checks.panel import find_faults
from app.panel.response_text import response_paths
from app.ros.messages import field_name, load_interfaces, parent_path
from app.ros.messages.field_path import Key, path_steps
from app.system.clock import format_time
from app.system.errors import InterfaceError, PanelError
from tests.cell.commands.test_presses import Way
from tests.support.builders import (
    BRIDGE,
    ENABLED,
    FREE,
    HEARD,
    INTERFACES,
    MESSAGE,
    NOW,
    Table,
    panel_of,
    press_widget,
    presses_of,
    robot_there,
)
from tests.support.words import english

JAZZY: Final = load_interfaces("jazzy")
JOINTS: Final = "sensor_msgs/msg/JointState"
DIAGNOSTICS: Final = "diagnostic_msgs/msg/DiagnosticArray"
STAMPED: Final[Table] = {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""}
AT: Final = f"received {format_time(NOW)}"


@pytest.mark.parametrize(
    ("path", "steps", "outside", "last"),
    [
        ("position[name=joint_2]", ["position", Key("name", "joint_2")], "", "position"),
        (
            "status[name='drive: motor'].level",
            ["status", Key("name", "drive: motor"), "level"],
            "status[name='drive: motor']",
            "level",
        ),
        ("a.b[2].c[x=-5]", ["a", "b", 2, "c", Key("x", "-5")], "a.b[2]", "c"),
        ("a[b.c=/x.y-z:1]", ["a", Key("b.c", "/x.y-z:1")], "", "a"),
        ("a[b='it''s [.=\"'].c", ["a", Key("b", "it's [.=\""), "c"], "a[b='it''s [.=\"']", "c"),
        ('a[b="say ""no"""]', ["a", Key("b", 'say "no"')], "", "a"),
        ("a[b='']", ["a", Key("b", "")], "", "a"),
        ("a[b=関節]", ["a", Key("b", "関節")], "", "a"),
    ],
)
def test_a_path_is_read_as_it_is_written(path: str, steps: list[Any], outside: str, last: str) -> None:
    assert list(path_steps(path)) == steps
    assert (parent_path(path), field_name(path)) == (outside, last)


@pytest.mark.parametrize(
    "path",
    ["a[b=]", "a[b=c d]", "a[b='c]", "a[b=c'd]", "a[=c]", "a[B=c]", "a[b=c].", ".a", "a..b", "a[b=c]d",
     "a[b = c]", "a[b==c]", "a[1", "a[b='c'd']", ""],
)  # fmt: skip
def test_malformed_path_is_refused(path: str) -> None:
    with pytest.raises(InterfaceError, match="is not a field: it must be like"):
        path_steps(path)


@pytest.mark.parametrize(
    ("type_name", "path", "kind"),
    [
        (JOINTS, "position[name=joint_2]", "float64"),
        (DIAGNOSTICS, "status[name=x].level", "byte"),
        (DIAGNOSTICS, "status[level=WARN].message", "string"),
        (DIAGNOSTICS, "status[level=2].values[key=t].value", "string"),
        (
            "tf2_msgs/msg/TFMessage",
            "transforms[header.frame_id=map].transform.translation.x",
            "float64",
        ),
        ("sensor_msgs/msg/MultiDOFJointState", "transforms[joint_names=a].rotation.w", "float64"),
        ("sensor_msgs/msg/PointCloud2", "fields[name=x].offset", "uint32"),
        ("action_msgs/msg/GoalStatusArray", "status_list[status=STATUS_EXECUTING].goal_info", None),
    ],
)
def test_type_of_an_element_chosen_by_key(type_name: str, path: str, kind: str | None) -> None:
    assert JAZZY.field_type(type_name, path) == (kind or "action_msgs/msg/GoalInfo")


@pytest.mark.parametrize(
    ("type_name", "path", "why"),
    [
        (JOINTS, "header[name=x]", "Header is not a list"),
        (JOINTS, "position[names=x]", "the lists beside it are name, position, velocity, effort"),
        (JOINTS, "position[header=x]", "the lists beside it are name"),
        (JOINTS, "name[position=1.5]", r'"position" .* is float64: a key is a text, a whole number'),
        (DIAGNOSTICS, "status[levle=2].name", "its elements have level, name, message, hardware_id"),
        (
            DIAGNOSTICS,
            "status[values=2].name",
            r"KeyValue\[\]: a key is a text, a whole number or a bool",
        ),
        (DIAGNOSTICS, "status[level=HOT].name", '"HOT" is none: .* OK, WARN, ERROR, STALE'),
        (DIAGNOSTICS, "status[level=256].name", "256 is out of range: byte goes from 0 to 255"),
        (DIAGNOSTICS, "status[name=x][name=y]", "is not a list"),
    ],
)
def test_a_key_that_the_type_has_not_is_refused(type_name: str, path: str, why: str) -> None:
    with pytest.raises(InterfaceError, match=why):
        JAZZY.field_type(type_name, path)


# What is shown and judged by them.


SELF_TEST: Final[Table] = {
    "id": "test", "kind": "call", "label": "Test", "service": "/test",
    "type": "diagnostic_msgs/srv/SelfTest",
}  # fmt: skip


def test_an_answer_says_an_element_by_its_key() -> None:
    answer = "{status[name='the drive'].message} {status[name=none].level}"
    assert list(find_faults(panel_of({**SELF_TEST, "answer": answer}), INTERFACES)) == []
    wrong = {**SELF_TEST, "answer": "{status[nmae=x].level}"}
    (fault,) = find_faults(panel_of(wrong), INTERFACES)
    assert fault.place == "page[0].widget[0].answer"
    name = "diagnostic_msgs/srv/SelfTest_Response"
    status = diagnostics(("x", 0), ("the drive", 2))["status"]
    status[1]["message"] = "too hot"
    payload = INTERFACES.encode(name, {"id": "", "passed": 0, "status": status})
    fields = INTERFACES.field_reader(name, response_paths(answer)).read(payload)
    assert with_fields(answer, fields) == "too hot —"


@pytest.mark.parametrize(("level", "outcome"), [(1, "confirmed"), (2, "unknown")])
def test_an_element_by_its_key_confirms(level: int, outcome: str) -> None:
    confirm = {"topic": "/heard", "type": DIAGNOSTICS, "field": "status[name=fan].level",
               "equals": 1, "within_s": 0.05}  # fmt: skip
    panel = panel_of(MESSAGE, {**FREE, "confirm": confirm})
    assert list(find_faults(panel, INTERFACES)) == []
    robot, way = robot_there(panel), Way()
    confirmations = Confirmations(robot, lambda _: None)
    presses = presses_of(panel, robot, way, confirmations=confirmations)

    async def test() -> None:
        press = asyncio.create_task(press_widget(presses, "free", {"message": "x"}, "p1"))
        while not confirmations.is_awaited("heard"):
            await asyncio.sleep(0)
        payload = INTERFACES.encode(DIAGNOSTICS, diagnostics(("a", 1), ("fan", level)))
        robot.update("heard", Sample(payload, 1, NOW + 1, NOW + 1, BRIDGE))
        confirmations.update("heard", robot.reading("/heard"))
        assert (await press).outcome == outcome

    asyncio.run(test())


def joints(names: list[str], positions: list[float]) -> Table:
    return {"header": STAMPED, "name": names, "position": positions, "velocity": [], "effort": []}


def diagnostics(*levels: tuple[str, int]) -> Table:
    more = {"message": "", "hardware_id": "", "values": []}
    status = [{"level": level, "name": name, **more} for name, level in levels]
    return {"header": STAMPED, "status": status}


def shown(widget: Table, fields: Table) -> dict[str, Any]:
    panel = panel_of({**HEARD, **widget})
    robot = robot_there(panel)
    payload = INTERFACES.encode(widget["type"], fields)
    robot.update("heard", Sample(payload, 1, NOW, NOW, BRIDGE))
    return build_view(panel, robot, NOW).view["widgets"]["heard"]


J2: Final[Table] = {"type": JOINTS, "field": "position[name=joint_2]", "unit": "rad"}
MISSING: Final = f"no position[name=joint_2] in the message {AT}"


@pytest.mark.parametrize(
    ("names", "positions", "state", "text", "note"),
    [
        (["joint_1", "joint_2"], [1.0, 2.0], "live", "2 rad", AT),
        (["joint_2", "joint_1"], [1.0, 2.0], "live", "1 rad", AT),
        (["joint_1"], [1.0], "missing", "—", MISSING),
        ([], [], "missing", "—", MISSING),
        (["joint_1", "joint_2"], [1.0], "missing", "—", MISSING),
        (["joint_2"], [1.0, 2.0], "missing", "—", MISSING),
        (["joint_2"], [], "missing", "—", MISSING),
        (["joint_2", "joint_2"], [1.0, 2.0], "missing", "—",
         f"position[name=joint_2] is more than once in the message {AT}"),
    ],
)  # fmt: skip
def test_a_readout_of_a_joint_by_its_name(
    names: list[str], positions: list[float], state: str, text: str, note: str
) -> None:
    assert english(shown(J2, joints(names, positions))) == {"state": state, "text": text, "note": note}


def test_a_lamp_and_a_readout_by_constants_of_an_element_by_its_name() -> None:
    level: Table = {"type": DIAGNOSTICS, "field": "status[name='drive: motor'].level"}
    states = [{"value": 0, "text": "Good", "shape": "circle"}]
    said = diagnostics(("a.b", 2), ("drive: motor", 0))
    assert shown({**level, "kind": "indicator", "states": states}, said)["text"] == "Good"
    dotted: Table = {"type": DIAGNOSTICS, "field": "status[name=a.b].level", "constants": "E"}
    assert shown(dotted, said)["text"].endswith("ERROR"[1:])


FILE: Final = """
title = "Cell"
[[interlock]]
id = "drive"
label = "Drive"
topic = "/operation_enabled"
type = "diagnostic_msgs/msg/DiagnosticArray"
field = "status[name='drive: motor'].level"
max = "WARN"
[[page]]
id = "one"
title = "One"
[[page.widget]]
id = "lamp"
kind = "indicator"
label = "Lamp"
topic = "/operation_enabled"
type = "diagnostic_msgs/msg/DiagnosticArray"
field = "status[name='drive: motor'].level"
states = [{ value = "OK", text = "Good", shape = "circle" }]
"""


@pytest.mark.parametrize(
    ("levels", "reason"),
    [
        ([("x", 2), ("drive: motor", 1)], None),
        ([("drive: motor", 2)], "Drive is ERROR: it must be WARN or less."),
        ([], "Locked: the last Drive has no status[name='drive: motor'].level."),
        (
            [("drive: motor", 0), ("drive: motor", 2)],
            "Locked: the last Drive has status[name='drive: motor'].level more than once.",
        ),
    ],
)
def test_an_interlock_by_the_state_of_one_device(
    tmp_path: Path, levels: list[tuple[str, int]], reason: str | None
) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(FILE)
    panel = load_panel(path)
    robot: RobotState = robot_there(panel)
    payload = INTERFACES.encode(DIAGNOSTICS, diagnostics(*levels))
    robot.update(robot.key(ENABLED), Sample(payload, 1, NOW, NOW, BRIDGE))
    assert english(interlock_verdict(panel.interlocks[0], robot, NOW).reason) == reason


def test_a_key_that_is_not_there_is_a_fault_of_the_panel(tmp_path: Path) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(FILE.replace("status[name=", "status[nmae="))
    with pytest.raises(PanelError) as caught:
        load_panel(path)
    places = [fault.place for fault in caught.value.faults]
    assert places == ["interlock[0].field", "page[0].widget[0].field"]
    path.write_text(FILE.replace("motor']", "motor]"))
    with pytest.raises(PanelError, match="is not a field: it must be like"):
        load_panel(path)

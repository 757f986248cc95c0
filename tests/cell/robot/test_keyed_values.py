"""Fields with keys keep their newest value and an age of their own over messages of several nodes."""

from typing import Any, Final

import pytest

from app.cell.permission.interlocks import interlock_verdict
from app.cell.robot.state import RobotState, Sample
from app.cell.robot.topics import KEPT_S
from app.cell.view.view import build_view
from app.ros.messages import FieldReader, Fields, Walk
from tests.support.builders import (
    BRIDGE,
    ENABLED,
    HEARD,
    INTERFACES,
    NOW,
    Table,
    endpoint,
    panel_of,
    robot_there,
)
from tests.support.words import english

STATE: Final = "sensor_msgs/msg/JointState"
LIFT: Final = "position[name=lift]"
LOCK: Final[Table] = {"type": STATE, "field": LIFT, "max": 0.5, "max_age_s": 1.0}
SHOWN: Final[Table] = {**HEARD, "topic": ENABLED, "type": STATE, "field": LIFT}


class Cell:
    """An arm and a gripper, which publish their joints on one topic."""

    def __init__(self, *widgets: Table, **interlock: Any) -> None:
        self.panel = panel_of(*(widgets or (SHOWN,)), interlock={**LOCK, **interlock})
        self.robot: RobotState = robot_there(self.panel)
        endpoint(self.robot, "MP", ENABLED, STATE)
        self._seq = 0

    def says(self, at: float, source: str = BRIDGE, **joints: float) -> None:
        self._seq += 1
        message = {"name": list(joints), "position": list(joints.values())}
        payload = INTERFACES.encode(STATE, message)
        key = self.robot.key(ENABLED)
        self.robot.update(key, Sample(payload, self._seq, at, at, source))

    def code(self, now: float) -> str:
        return interlock_verdict(self.panel.interlocks[0], self.robot, now).code

    def shown(self, now: float, widget: str = "heard") -> Any:
        return english(build_view(self.panel, self.robot, now).view["widgets"][widget])


def test_a_message_of_another_node_does_not_lock() -> None:
    cell = Cell()
    for number in range(10):
        at = NOW + number / 10
        cell.says(at, lift=0.25)
        assert cell.code(at) == "permitted"
        cell.says(at, finger=0.1)
        assert cell.code(at) == "permitted"
        assert cell.shown(at)["text"] == "0.25"


def test_each_keyed_entry_has_its_own_age() -> None:
    cell = Cell()
    cell.says(NOW, lift=0.25)
    for number in range(10):
        cell.says(NOW + number / 10, finger=0.1)
    verdict = interlock_verdict(cell.panel.interlocks[0], cell.robot, NOW + 0.9)
    assert (verdict.permitted, verdict.until) == (True, NOW + 1.0)
    assert cell.code(NOW + 1.0) == "interlock_stale_field"


def test_without_an_age_an_entry_that_newer_messages_lack_is_missing() -> None:
    cell = Cell(max_age_s=None)
    cell.says(NOW, lift=0.25)
    cell.says(NOW + KEPT_S, finger=0.1)
    assert (cell.code(NOW), cell.shown(NOW)["state"]) == ("permitted", "live")
    cell.says(NOW + KEPT_S + 0.1, finger=0.1)
    assert (cell.code(NOW), cell.shown(NOW)["state"]) == ("interlock_field_missing", "missing")


def test_key_never_received_is_missing_though_others_are_known() -> None:
    cell = Cell()
    cell.says(NOW, finger=0.1)
    assert cell.code(NOW) == "interlock_field_missing"


def test_a_newer_value_counts_at_once_and_an_ambiguous_one_locks() -> None:
    cell = Cell()
    cell.says(NOW, lift=0.25)
    cell.says(NOW, finger=0.1)
    cell.says(NOW, lift=0.75)
    assert cell.code(NOW) == "interlock_condition_unmet"
    payload = INTERFACES.encode(STATE, {"name": ["lift", "lift"], "position": [0.1, 0.2]})
    cell.robot.update(cell.robot.key(ENABLED), Sample(payload, 99, NOW, NOW, BRIDGE))
    assert cell.code(NOW) == "interlock_field_ambiguous"


@pytest.mark.parametrize("how", ["cut", "doubt", "lose"])
def test_no_entry_from_before_a_cut_counts(how: str) -> None:
    cell = Cell()
    cell.says(NOW, lift=0.25)
    if how == "doubt":
        cell.robot.invalidate(cell.robot.key(ENABLED))
    elif how == "cut":
        cell.robot.mark_peer_lost(BRIDGE, 99)
    else:
        cell.robot.mark_link_lost()
        cell.robot.link_up, cell.robot.settled_at = True, 0.0
        cell.robot.graph.apply_token(f"@/{BRIDGE}/@ros2_lv", True)
    cell.says(NOW, finger=0.1)
    assert cell.code(NOW) == "interlock_field_missing"


def test_the_entries_of_a_lost_bridge_end_with_it() -> None:
    cell = Cell()
    cell.robot.graph.apply_token("@/b2/@ros2_lv", True)
    cell.says(NOW, "b2", lift=0.25)
    cell.says(NOW, finger=0.1)
    assert cell.code(NOW) == "permitted"
    cell.robot.graph.apply_token("@/b2/@ros2_lv", False)
    cell.robot.mark_peer_lost("b2", 99)
    assert cell.code(NOW) == "interlock_field_missing"


def test_a_part_of_the_joints_that_is_old_is_named() -> None:
    joints = [{"name": name, "min": -1, "max": 1, "unit": "rad"} for name in ("lift", "finger")]
    arm = {"id": "arm", "kind": "joints", "label": "Arm", "topic": ENABLED, "joint": joints}
    cell = Cell({**arm, "max_age_s": 1.0})
    cell.says(NOW, lift=0.25)
    cell.says(NOW + 0.5, finger=0.5)
    both = cell.shown(NOW + 0.5, "arm")
    assert (both["state"], both["joint_values"], both["said"]) == ("live", ["+0.2", "+0.5"], "")
    cell.says(NOW + 2.5, finger=0.5)
    parts = cell.shown(NOW + 2.5, "arm")
    assert (parts["state"], parts["joint_levels"]) == ("live", ["missing", "normal"])
    assert parts["said"] == "lift: 2 s old"
    gone = cell.shown(NOW + 9, "arm")
    assert (gone["state"], gone["joint_levels"]) == ("old", ["", ""])


def test_entries_by_their_place_are_those_of_the_newest_message() -> None:
    cell = Cell({**SHOWN, "field": "position[1]"})
    cell.says(NOW, lift=0.25, tilt=0.5)
    assert cell.shown(NOW)["text"] == "0.5"
    cell.says(NOW, finger=0.1)
    assert cell.shown(NOW)["state"] == "missing"


def test_with_one_publisher_each_message_is_the_whole_list() -> None:
    cell = Cell(publishers="one")
    cell.says(NOW, lift=0.25)
    assert cell.code(NOW) == "permitted"
    cell.says(NOW + 0.1, finger=0.1)
    assert cell.code(NOW + 0.1) == "interlock_field_missing"


def test_where_the_newest_message_has_all_the_others_are_not_decoded(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of one publisher a display needs the newest only, however many come between two frames."""
    shown = {**SHOWN, "topic": "/joints"}
    cell = Cell(shown, {**shown, "id": "other", "field": "position[name=finger]"})
    decoded: list[int] = []
    walk = FieldReader.walk

    def counted(reader: FieldReader, data: bytes, received: float) -> Walk[Fields]:
        decoded.append(len(data))
        return walk(reader, data, received)

    monkeypatch.setattr(FieldReader, "walk", counted)

    def says(seq: int, **joints: float) -> None:
        message = {"name": list(joints), "position": list(joints.values())}
        payload = INTERFACES.encode(STATE, message)
        cell.robot.update("joints", Sample(payload, seq, NOW, NOW, BRIDGE))

    for seq in range(50):
        says(seq, lift=0.25, finger=seq / 100)
    assert [cell.shown(NOW, name)["text"] for name in ("heard", "other")] == ["0.25", "0.49"]
    assert len(decoded) == 2
    decoded.clear()
    for seq in range(50):
        says(seq, **({"lift": 0.5} if seq % 2 else {"finger": 0.25}))
    assert [cell.shown(NOW, name)["text"] for name in ("heard", "other")] == ["0.5", "0.25"]
    assert len(decoded) == 51

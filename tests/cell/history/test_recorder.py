"""Every sample of a trend's fields is recorded, in slices, with a gap where something is not known."""

import asyncio
import math
import time
from collections.abc import Coroutine
from types import SimpleNamespace
from typing import Any, Final

import pytest

from app.cell.history import trends as recorders
from app.cell.history.trends import TrendRecorder
from app.cell.robot.history import FieldHistory
from app.cell.robot.state import RobotState, Sample
from app.panel.model import Panel
from tests.support.builders import BRIDGE, INTERFACES, Table, panel_of, robot_there
from tests.support.waiting import turns, when

FLOAT: Final = "std_msgs/msg/Float64"
JOINTS: Final = "sensor_msgs/msg/JointState"
PEN: Final[Table] = {"topic": "/speed", "type": FLOAT, "label": "Speed"}
TREND: Final[Table] = {"id": "course", "kind": "trend", "label": "Course", "pen": [PEN]}
JOINT_PENS: Final = [
    {"topic": "/joints", "type": JOINTS, "field": f"position[{n}]", "label": f"J{n}"} for n in range(3)
]


class Recorded:
    """A recorder of a panel, and its robot."""

    def __init__(self, panel: Panel) -> None:
        self.robot: RobotState = robot_there(panel)
        self.recorder = TrendRecorder(panel, INTERFACES, self.robot)
        self._seq = 0

    def says(self, data: float | bytes, topic: str = "/speed", source: str = BRIDGE) -> None:
        payload = data if isinstance(data, bytes) else INTERFACES.encode(FLOAT, {"data": data})
        self.payload(payload, topic, source)

    def payload(self, payload: bytes, topic: str = "/speed", source: str = BRIDGE) -> None:
        self._seq += 1
        sample = Sample(payload, self._seq, time.monotonic(), time.time(), source)
        key = self.robot.key(topic)
        self.robot.update(key, sample)
        self.recorder.record_sample(key, sample)

    def field(self, topic: str = "/speed", field: str = "data") -> FieldHistory:
        return self.robot.history.fields[self.robot.key(topic), field]

    async def decoded(self) -> None:
        await when(lambda: not self.recorder._pending)

    def values(self) -> list[tuple[float, bool]]:
        raw = self.field().raw
        return [(value, bool(gap)) for value, gap in zip(raw.last, raw.gaps, strict=True)]


def run(work: Coroutine[Any, Any, None]) -> None:
    asyncio.run(work)


def test_every_sample_of_a_topic_is_recorded() -> None:
    async def work() -> None:
        cell = Recorded(panel_of(TREND))
        assert cell.recorder.keys == {"speed"}
        for number in range(500):
            cell.says(float(number))
        await cell.decoded()
        assert [value for value, _ in cell.values()] == [float(number) for number in range(500)]
        assert [gap for _, gap in cell.values()] == [True, *[False] * 499]

    run(work())


def test_several_fields_of_a_topic_are_read_together() -> None:
    async def work() -> None:
        cell = Recorded(panel_of({**TREND, "pen": JOINT_PENS}))
        fields = {"name": ["a", "b"], "position": [1.0, 2.0], "velocity": [], "effort": []}
        cell.payload(INTERFACES.encode(JOINTS, fields), "/joints")
        await cell.decoded()
        for number, expected in enumerate([[1.0], [2.0], []]):
            assert list(cell.field("/joints", f"position[{number}]").raw.last) == expected

    run(work())


@pytest.mark.parametrize("cut", ["link", "bridge", "another bridge", "unreadable", "nan"])
def test_unknown_value_is_a_gap(cut: str) -> None:
    async def work() -> None:
        cell = Recorded(panel_of(TREND))
        cell.says(1.0)
        if cut == "link":
            cell.robot.mark_link_lost()
        elif cut == "bridge":
            cell.robot.mark_peer_lost(BRIDGE, 100)
        elif cut == "unreadable":
            cell.says(b"\x00\x01\x00\x00abc")
        elif cut == "nan":
            cell.says(math.nan)
        cell.says(2.0, source="f" * 32 if cut == "another bridge" else BRIDGE)
        cell.says(3.0, source="f" * 32 if cut == "another bridge" else BRIDGE)
        await cell.decoded()
        assert cell.values() == [(1.0, True), (2.0, True), (3.0, False)]

    run(work())


def test_a_flood_is_decoded_in_slices() -> None:
    """Nothing else waits for it: between two slices the loop turns."""

    async def work() -> None:
        cell = Recorded(panel_of(TREND))
        for number in range(recorders.MAX_PENDING):
            cell.says(float(number))
        turns = 0
        async with asyncio.timeout(20):
            while cell.recorder._pending:
                turns += bool(cell.values())
                await asyncio.sleep(0)
        assert turns > 3
        assert len(cell.values()) == recorders.MAX_PENDING

    run(work())


def test_waiting_samples_are_bounded_and_dropped_samples_are_a_gap(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async def work() -> None:
        cell = Recorded(panel_of(TREND))
        for number in range(15):
            cell.says(float(number))
        assert len(cell.recorder._pending) == 10
        await cell.decoded()
        assert cell.values()[0] == (5.0, True)
        assert len(cell.values()) == 10

    monkeypatch.setattr(recorders, "MAX_PENDING", 10)
    run(work())


def test_old_samples_are_removed_while_recording(monkeypatch: pytest.MonkeyPatch) -> None:
    async def work() -> None:
        cell = Recorded(panel_of(TREND))
        for number in range(2_000):
            cell.field().add(cell.robot.history.start - 5_000 + number / 100, 1.0)
        cell.says(2.0)
        await cell.decoded()
        assert [value for value, _ in cell.values()] == [2.0]

    monkeypatch.setattr(recorders, "FORGET_EVERY", 1)
    run(work())


def test_waiting_samples_are_decoded_at_shutdown() -> None:
    async def work() -> None:
        cell = Recorded(panel_of(TREND))
        cell.says(1.0)
        cell.recorder.stop()
        assert cell.values() == [(1.0, True)]

    run(work())


def test_two_trends_share_the_history_of_a_field_for_the_longer_time() -> None:
    async def work() -> None:
        other = {**TREND, "id": "other", "keep": "7d", "disk": True}
        cell = Recorded(panel_of(TREND, other))
        assert list(cell.robot.history.fields) == [("speed", "data")]
        assert cell.field().keep_s == 7 * 86_400

    run(work())


def test_a_decoder_that_fails_once_loses_one_sample_and_ends_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    recorded = Recorded(panel_of(TREND))
    reader = recorded.recorder._readers[recorded.robot.key("/speed")]
    read, failures = reader.read, [KeyError("broken")]

    def fails_once(data: bytes, wall: float) -> Any:
        if failures:
            raise failures.pop()
        return read(data, wall)

    monkeypatch.setattr(recorded.recorder, "_readers", {"speed": SimpleNamespace(read=fails_once)})

    async def work() -> None:
        recorded.says(1.0)
        await recorded.decoded()
        await turns()
        recorded.says(2.0)
        await recorded.decoded()

    run(work())
    assert recorded.values() == [(2.0, True)]

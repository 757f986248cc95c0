"""What is large is read in slices: nothing waits for it, nothing is permitted by a part of it, the
newest counts, and what came while another one was read is read too."""

import asyncio
import time
from collections.abc import Callable, Coroutine
from typing import Any, Final

import pytest

from app.cell.permission.interlocks import interlock_verdict
from app.cell.robot.state import Reading, RobotState, Sample
from app.cell.robot.topics import MAX_UNREAD, MAX_UNREAD_BYTES, MAX_UNREAD_PARTS, Slices
from app.cell.view.view import build_view
from app.panel.model import Panel
from app.system.errors import DecodeError
from tests.support.builders import (
    BRIDGE,
    DIALECT,
    ENABLED,
    FREE,
    HEARD,
    INTERFACES,
    KIOSK,
    MESSAGE,
    NOW,
    TRAITS,
    Table,
    panel_of,
)
from tests.support.form import several
from tests.support.large import KINDS, LITTLE, STATUS, TEN_MB, diagnostics, garbage
from tests.support.waiting import when

LONGEST_TURN_S: Final = 0.05
MEGABYTES: Final = several(3_000_000, TEN_MB)
DIAGNOSTICS: Final = "diagnostic_msgs/msg/DiagnosticArray"
SIZE: Final = 200_000  # of a message that takes several turns of a clock that runs fast
COUNT: Final = SIZE // len(STATUS)
LEVEL: Final[Table] = {
    "type": DIAGNOSTICS, "field": "status[name=drive].level", "max": 1,
}  # fmt: skip
SHOWN: Final[Table] = {**HEARD, "type": DIAGNOSTICS, "field": "status[name=drive].level"}
CONFIRM: Final[Table] = {
    "topic": "/heard", "type": DIAGNOSTICS, "field": "status[name=drive].level", "equals": 1,
}  # fmt: skip


class Clock:
    """Ten milliseconds pass with every look at it."""

    def __init__(self) -> None:
        self.now = NOW

    def __call__(self) -> float:
        self.now += 0.01
        return self.now


class Cell:
    """A robot that is there, whose large messages take several turns."""

    def __init__(self, *widgets: Table, interlock: Table = LEVEL, path: str = LEVEL["field"]) -> None:
        self.panel: Panel = panel_of(*(widgets or (MESSAGE, FREE, SHOWN)), interlock=interlock)
        slices, later = Slices(Clock()), self._read_later
        self.robot = RobotState(
            self.panel, INTERFACES, DIALECT, TRAITS, KIOSK, None, slices, on_late_reading=later
        )
        self.robot.link_up, self.robot.settled_at = True, 0.0
        self.robot.graph.apply_token(f"@/{BRIDGE}/@ros2_lv", True)
        self.read: list[tuple[str, Any]] = []
        self._seq = 0
        self._path = path

    def _read_later(self, key: str, reading: Reading) -> None:
        self.read.append((key, reading.value(self._path)))

    def says(self, level: int | None, topic: str = ENABLED, size: int = SIZE) -> None:
        """A large message; None is one that is no message, which shows at its end."""
        self._seq += 1
        data = diagnostics(size, b"drive").data
        assert data.count(b"drive\0") == 1
        data = bytes(data) if level is None else _with_level(data, level)
        data += bytes(8) if level is None else b""
        self.robot.update(self.robot.key(topic), Sample(data, self._seq, NOW, NOW, BRIDGE))

    @property
    def locked_by(self) -> str:
        return interlock_verdict(self.panel.interlocks[0], self.robot, NOW).code

    @property
    def shown(self) -> tuple[str, str]:
        view = build_view(self.panel, self.robot, NOW).view["widgets"]["heard"]
        return view["state"], view["text"]

    async def all_read(self, topic: str = ENABLED) -> None:
        await when(lambda: self.robot.reading(topic).status != "reading")


def _with_level(data: bytes, level: int) -> bytes:
    at = data.index(b"\6\0\0\0drive\0") - 4
    return data[:at] + bytes([level]) + data[at + 1 :]


def run(test: Callable[[], Coroutine[Any, Any, None]]) -> None:
    asyncio.run(test())


def test_large_message_permits_only_after_complete_decoding() -> None:
    async def test() -> None:
        cell = Cell()
        cell.says(0)
        assert cell.locked_by == "interlock_reading"
        await asyncio.sleep(0)
        assert cell.locked_by == "interlock_reading"  # a part of it was read
        await cell.all_read()
        assert cell.locked_by == "permitted"
        cell.says(2)
        assert cell.locked_by == "interlock_reading"  # what was said before is not so any more
        await cell.all_read()
        assert cell.locked_by == "interlock_condition_unmet"
        assert cell.read == [("operation_enabled", 0), ("operation_enabled", 2)]

    run(test)


def test_small_message_is_decoded_while_a_large_one_is_in_progress() -> None:
    async def test() -> None:
        cell = Cell()
        cell.says(0, "/heard")
        cell.robot.reading("/heard")
        cell.says(0, size=1000)
        assert cell.locked_by == "permitted"
        cell.says(2, size=1000)
        assert cell.locked_by == "interlock_condition_unmet"

    run(test)


def test_truncated_message_locks() -> None:
    async def test() -> None:
        cell = Cell()
        cell.says(None)
        assert cell.locked_by == "interlock_reading"
        await cell.all_read()
        assert cell.locked_by == "interlock_unreadable"
        assert cell.robot.traffic.undecodable == {"operation_enabled": 1}

    run(test)


def test_a_small_message_behind_a_large_one_is_the_newest() -> None:
    async def test() -> None:
        for levels in ((0, 2), (2, 0)):
            cell = Cell()
            cell.says(levels[0])
            assert cell.locked_by == "interlock_reading"
            cell.says(levels[1], size=1000)
            assert cell.locked_by == "interlock_reading"
            await cell.all_read()
            assert cell.locked_by == ("interlock_condition_unmet" if levels[1] else "permitted")

    run(test)


def test_readout_shows_the_previous_value_while_the_newest_is_decoded() -> None:
    async def test() -> None:
        cell = Cell()
        cell.says(0, "/heard")
        assert cell.shown == ("waiting", "—")
        await cell.all_read("/heard")
        assert cell.shown == ("live", "0")
        for level in (1, 2, 3):
            cell.says(level, "/heard")
            assert cell.shown == ("live", "0")
        await cell.all_read("/heard")
        assert cell.shown == ("live", "3")
        assert [value for _, value in cell.read] == [0, 1, 2, 3]

    run(test)


def test_without_a_key_the_newest_counts_and_those_between_are_passed_over() -> None:
    async def test() -> None:
        cell = Cell(MESSAGE, FREE, {**SHOWN, "field": f"status[{COUNT - 1}].level"})
        cell.says(0, "/heard")
        await cell.all_read("/heard")
        for level in (1, 2, 3):
            cell.says(level, "/heard")
            assert cell.shown == ("live", "0")
        await cell.all_read("/heard")
        assert cell.shown == ("live", "3")
        assert len(cell.read) == 3

    run(test)


def test_of_parts_of_a_list_so_many_are_read_and_then_the_newest() -> None:
    async def test() -> None:
        cell = Cell()
        for level in range(2 * MAX_UNREAD_PARTS):
            cell.says(level % 200, "/heard")
        await cell.all_read("/heard")
        assert MAX_UNREAD_BYTES // SIZE - 1 <= len(cell.read) <= MAX_UNREAD_PARTS + 1
        assert cell.shown == ("live", str((2 * MAX_UNREAD_PARTS - 1) % 200))

    run(test)


def test_messages_of_a_lossless_topic_are_decoded_in_order() -> None:
    async def test() -> None:
        place = f"status[{COUNT - 1}].level"
        cell = Cell(MESSAGE, {**FREE, "confirm": {**CONFIRM, "field": place}}, path=place)
        for level in range(5):
            cell.says(level, "/heard")
            cell.robot.reading("/heard")
        await cell.all_read("/heard")
        assert [value for _, value in cell.read] == [0, 1, 2, 3, 4]
        for level in range(3 * MAX_UNREAD):
            cell.says(level, "/heard")
            cell.robot.reading("/heard")
        await cell.all_read("/heard")
        values = [value for _, value in cell.read][5:]
        assert values == [0, *range(2 * MAX_UNREAD, 3 * MAX_UNREAD)]

    run(test)


@pytest.mark.parametrize("how", ["cut", "lose", "doubt"])
def test_message_in_decoding_at_a_cut_never_counts(how: str) -> None:
    async def test() -> None:
        cell = Cell()
        cell.says(0)
        assert cell.locked_by == "interlock_reading"
        if how == "cut":
            cell.robot.mark_peer_lost(BRIDGE, 99)
        elif how == "doubt":
            cell.robot.invalidate("operation_enabled")
        else:
            cell.robot.mark_link_lost()
        for _ in range(1000):
            await asyncio.sleep(0)
        assert cell.robot.reading(ENABLED).status == "cut"
        assert cell.robot.reading(ENABLED).value("status[name=drive].level") is None
        assert cell.read == []

    run(test)


# How long a turn of the loop takes, by the processor's time: another program may stop this one.


async def longest_turn(work: Callable[[], bool]) -> float:
    """Calls `work` each turn until it is through; the longest time between two turns."""
    longest, before = 0.0, time.thread_time()
    through = False
    async with asyncio.timeout(120):
        while not through:
            through = work()
            await asyncio.sleep(0)
            now = time.thread_time()
            longest, before = max(longest, now - before), now
    return longest


@pytest.mark.parametrize("kind", list(KINDS))
def test_megabytes_of_anything_hold_up_nothing(kind: str) -> None:
    large = KINDS[kind](MEGABYTES)
    assert len(large.data) > 0.99 * MEGABYTES
    panel = panel_of({**HEARD, "type": large.type, "field": large.path})
    robot = RobotState(panel, INTERFACES, DIALECT, TRAITS, KIOSK)
    robot.update("heard", Sample(large.data, 1, NOW, NOW, None))

    def is_read() -> bool:
        return robot.reading("/heard").status == "message"

    async def test() -> None:
        assert await longest_turn(is_read) < LONGEST_TURN_S
        assert robot.reading("/heard").value(large.path) == large.value

    run(test)


def test_megabytes_of_garbage_hold_up_nothing() -> None:
    large = garbage(MEGABYTES)
    panel = panel_of({**HEARD, "type": large.type, "field": large.path})
    robot = RobotState(panel, INTERFACES, DIALECT, TRAITS, KIOSK)
    robot.update("heard", Sample(large.data, 1, NOW, NOW, None))

    async def test() -> None:
        assert (
            await longest_turn(lambda: robot.reading("/heard").status == "unreadable") < LONGEST_TURN_S
        )

    run(test)


@pytest.mark.parametrize("kind", ["diagnostics by name", "nested lists", "a text"])
def test_an_answer_of_any_size_is_read_while_all_else_goes_on(kind: str) -> None:
    large = KINDS[kind](TEN_MB)
    reader = INTERFACES.field_reader(large.type, [large.path])

    async def test() -> None:
        reading = asyncio.ensure_future(Slices().read_all(reader, large.data))
        assert await longest_turn(reading.done) < LONGEST_TURN_S
        assert reading.result().get(large.path) == large.value

    run(test)


def test_invalid_reply_is_reported_and_delays_no_other() -> None:
    large = diagnostics(1_000_000)
    reader = INTERFACES.field_reader(large.type, [large.path])

    async def test() -> None:
        slices = Slices()
        short = asyncio.ensure_future(slices.read_all(reader, large.data[:-40]))
        whole = asyncio.ensure_future(slices.read_all(reader, large.data))
        with pytest.raises(DecodeError):
            await short
        assert (await whole).get(large.path) == large.value

    run(test)


def test_a_whole_message_of_many_elements_is_not_built() -> None:
    """Such as a status of goals: what lists them may be anyone's."""
    many = "action_msgs/msg/GoalStatusArray"
    status = bytes(28)
    few = LITTLE + (1000).to_bytes(4, "little") + status * 999 + status[:25]
    assert len(INTERFACES.decode(many, few).status_list) == 1000
    count = TEN_MB // 28
    data = LITTLE + count.to_bytes(4, "little") + status * count
    before = time.thread_time()
    with pytest.raises(DecodeError, match="more than 2000 elements"):
        INTERFACES.decode(many, data)
    assert time.thread_time() - before < LONGEST_TURN_S


# Additions that take 10 ms on the machine for which `LONGEST_TURN_S` was chosen.
ADDITIONS: Final = 200_000
ADDITIONS_S: Final = 0.01


def test_the_most_parameters_that_one_event_may_have_are_read_in_a_moment() -> None:
    """Compared with additions in the same moment: a processor is slower beside other work."""
    event = "rcl_interfaces/msg/ParameterEvent"
    parameter = {"value": {"type": 4, "string_value": "x" * 20}}
    changed = [{"name": f"parameter_{number}", **parameter} for number in range(1990)]
    data = INTERFACES.encode(event, {"node": "/arm", "changed_parameters": changed})
    ratios = []
    for _ in range(5):  # the least: another program shares the processor
        begin = time.thread_time()
        assert sum(number & 7 for number in range(ADDITIONS)) > 0
        middle = time.thread_time()
        assert len(INTERFACES.decode(event, data).changed_parameters) == 1990
        ratios.append((time.thread_time() - middle) / (middle - begin))
    assert min(ratios) < LONGEST_TURN_S / ADDITIONS_S


def test_a_decoder_that_fails_is_a_message_that_can_not_be_read(
    caplog: pytest.LogCaptureFixture,
) -> None:
    class Broken:
        def advance(self) -> None:
            raise KeyError("broken")

    with pytest.raises(DecodeError, match="decoder failed: 'broken'"):
        Slices(Clock()).read_until(Broken(), NOW + 1)
    assert "a message can't be decoded" in caplog.text

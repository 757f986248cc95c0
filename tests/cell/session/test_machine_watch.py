"""What a watch of the machine writes into the operator's log: its time source, and robots' clocks."""

import json
from typing import Any

from app.cell.robot.clocks import Skew
from app.cell.session.machine_watch import MachineWatch
from app.cell.view.machine_status import Machine, Postponed
from app.records.entry import Entry
from app.system.errors import LogError
from app.system.texts import Text, text_in
from app.system.time_source import TimeSource


class Log:
    def __init__(self) -> None:
        self.entries: list[Entry] = []
        self.fault = ""

    def add(self, entry: Entry) -> None:
        if self.fault:
            raise LogError(self.fault)
        self.entries.append(entry)

    def new(self) -> list[tuple[str, dict[str, Any]]]:
        """Robot and values of each entry since the last call."""
        rows = [(entry.robot, json.loads(entry.values)) for entry in self.entries]
        assert all(entry.kind == "clock" for entry in self.entries)
        self.entries.clear()
        return rows


class Unread:
    """A reader that is not asked."""

    def read(self) -> Machine:
        raise AssertionError

    def postpone(self, postponed: Postponed) -> None:
        raise AssertionError


class Watched:
    def __init__(self) -> None:
        self.log = Log()
        self.skews: dict[str, Skew | None] = {}
        self.watch = MachineWatch(self.log, lambda: self.skews, Unread())

    def look(self, time: TimeSource | None = None) -> list[tuple[str, dict[str, Any]]]:
        if time is not None:
            self.watch.now = Machine(time)
        self.watch.log_changes()
        return self.log.new()


def test_the_time_source_is_logged_at_the_start_and_when_it_changes() -> None:
    cell = Watched()
    assert cell.look(TimeSource()) == [("", {})]
    assert cell.look() == []
    by_chrony = {"synchronised": True, "source": "chrony", "within_s": 0.002}
    assert cell.look(TimeSource(True, "chrony", 0.002)) == [("", by_chrony)]
    assert cell.look(TimeSource(True, "chrony", 0.003)) == []  # how exact it is changes all the time
    assert cell.look(TimeSource(False, "chrony")) == [("", {"synchronised": False, "source": "chrony"})]
    assert cell.look(TimeSource(False)) == [("", {"synchronised": False})]


def test_the_entry_says_what_to_do() -> None:
    cell = Watched()
    cell.watch.now = Machine(TimeSource(False))
    cell.watch.log_changes()
    reason = text_in(cell.log.entries[0].text)
    assert isinstance(reason, Text)
    parts = dict(reason.params)["parts"]
    assert isinstance(parts, tuple)
    codes = [part.code for part in parts if isinstance(part, Text)]
    assert codes == ["time_unsynchronised", "time_unsynchronised_do"]


def test_the_skew_of_each_robot_is_logged_when_it_is_known_and_when_it_moves() -> None:
    cell = Watched()
    cell.look(TimeSource(True))
    cell.skews = {"r1": None, "r2": Skew(0.0123, "peer")}
    assert cell.look() == [("r2", {"skew_s": 0.012, "by": "peer"})]
    cell.skews["r2"] = Skew(-0.4, "peer")
    assert cell.look() == []  # still the same clock
    cell.skews["r2"] = Skew(1.2, "peer")
    assert cell.look() == [("r2", {"skew_s": 1.2, "by": "peer"})]
    cell.skews["r2"] = None  # a lost link says nothing of a clock
    assert cell.look() == []
    cell.skews["r2"] = Skew(1.3, "peer")
    assert cell.look() == []
    cell.skews = {"r1": Skew(100.0, "stamps"), "r2": Skew(0.0, "peer")}
    assert [robot for robot, _ in cell.look()] == ["r1", "r2"]
    cell.skews["r1"] = Skew(115.0, "stamps")
    assert cell.look() == []  # a clock that drifts writes no entry each second
    cell.skews["r1"] = Skew(125.0, "stamps")
    assert [robot for robot, _ in cell.look()] == ["r1"]


def test_what_the_log_does_not_take_is_tried_again() -> None:
    cell = Watched()
    cell.skews = {"": Skew(3.0, "peer")}
    cell.log.fault = "full"
    assert cell.look(TimeSource(True)) == []
    cell.log.fault = ""
    assert [robot for robot, _ in cell.look()] == ["", ""]
    assert cell.look() == []

"""Messages of diagnostics and lists become alarms, whatever a robot sends."""

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote, unquote, urljoin, urlsplit

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.cell.alarms.published import (
    CHUNK,
    LONGEST_ENTRY_NAME,
    LONGEST_TEXT,
    MAX_QUEUED,
    MAX_STATUSES,
    AlarmEntry,
    PublishedAlarms,
    entry_name,
)
from app.cell.robot.topics import Slices
from app.panel import load_panel
from app.panel.model import Panel
from app.ros.zenoh.sample import Sample
from app.system.texts import render
from tests.cell.alarms.test_engine import FAULTS, HEALTH, PANEL
from tests.support.builders import INTERFACES

ARRAY = "diagnostic_msgs/msg/DiagnosticArray"


class Received:
    """What a robot's messages become."""

    def __init__(self, panel: Panel) -> None:
        self.entries: list[AlarmEntry] = []
        self.whole: list[bool] = []
        self.fails = False
        self.listener = PublishedAlarms(
            panel, "", INTERFACES, lambda topic: [topic.lstrip("/")], Slices(), self.receive
        )

    def receive(
        self,
        _: str,
        entries: Sequence[AlarmEntry],
        __: float,
        is_last: bool,
        earlier: Collection[str],
        unread: int,
    ) -> None:
        if self.fails:
            raise RuntimeError("a fault of the program")
        self.entries += entries
        self.whole.append(is_last and not unread)
        self.earlier = set(earlier)

    def send(self, *statuses: Mapping[str, Any], topic: str = "diagnostics") -> None:
        self.send_bytes(INTERFACES.encode(ARRAY, {"status": list(statuses)}), topic)

    def send_bytes(self, payload: bytes, topic: str = "diagnostics") -> None:
        self.listener.record_sample(topic, Sample(payload, 1, 0.0, 0.0, "b1"))


def received(folder: Path, alarms: str) -> Received:
    path = folder / "cell.toml"
    path.write_text(PANEL + alarms)
    return Received(load_panel(path))


def test_a_status_has_its_message_and_key_values(tmp_path: Path) -> None:
    robot = received(tmp_path, HEALTH)
    values = [{"key": "rpm", "value": "1200"}, {"key": "load", "value": "80 %"}]
    robot.send(
        {"name": "motor 7", "level": 2, "message": "Hot\x1b[31m", "values": values},
        {"name": "lamp", "level": 2, "message": "Dark"},
    )
    (entry,) = robot.entries
    assert (entry.name, entry.level, entry.text) == ("motor 7", 2, "Hot")
    assert entry.details == "rpm: 1200, load: 80 %"


def test_a_status_is_read_again_where_it_has_changed(tmp_path: Path) -> None:
    robot = received(tmp_path, HEALTH)
    hot: dict[str, Any] = {"name": "motor 7", "level": 2, "message": "Hot"}
    rpm = [{"key": "rpm", "value": "1200"}]
    for status in (
        {**hot, "level": 0, "message": "OK"},
        {**hot, "values": rpm},
        {**hot, "values": rpm},
        {**hot, "values": [{"key": "rpm", "value": "900"}]},
        {**hot, "level": 1, "values": rpm},
        {**hot, "hardware_id": "m7", "message": "", "values": rpm},
    ):
        robot.entries.clear()
        robot.send({"name": "lamp", "level": 0}, status, {**status, "name": "motor 8"})
        level, text = status["level"], status["message"] or "m7"
        details = f"rpm: {status['values'][0]['value']}" if level else ""
        expected = [("motor 7", level, text, details), ("motor 8", level, text, details)]
        assert [(e.name, e.level, e.text, e.details) for e in robot.entries] == expected


def test_a_status_whose_key_values_are_no_texts_is_an_alarm(tmp_path: Path) -> None:
    robot = received(tmp_path, HEALTH)
    values = [{"key": "rpm", "value": "1200"}]
    payload = INTERFACES.encode(ARRAY, {"status": [{"name": "motor 7", "level": 2, "values": values}]})
    robot.send_bytes(payload.replace(b"1200", b"12\xff\xff"))
    ((name, level, details),) = [(e.name, e.level, e.details) for e in robot.entries]
    assert (name, level, details) == ("motor 7", 2, "")


def test_statuses_of_any_length_are_read(tmp_path: Path) -> None:
    robot = received(tmp_path, HEALTH)
    texts = ["a" * n for n in (1, 2, 3, 4, 5, 990, 999, 1_000, 1_001, 5_000)]
    for _ in range(2):
        robot.entries.clear()
        robot.send(*({"name": f"motor {i}", "level": 1, "message": t} for i, t in enumerate(texts)))
        assert [str(entry.text) for entry in robot.entries] == [t[:LONGEST_TEXT] for t in texts]


def test_a_message_with_more_statuses_than_are_read_is_bounded(tmp_path: Path) -> None:
    robot = received(tmp_path, HEALTH)
    robot.send(*({"name": f"motor {i}", "level": 1} for i in range(MAX_STATUSES + 3)))
    assert len(robot.entries) == MAX_STATUSES
    assert set(robot.whole) == {False}


def test_bytes_that_are_no_message_raise_nothing(tmp_path: Path) -> None:
    robot = received(tmp_path, HEALTH)
    whole = INTERFACES.encode(ARRAY, {"status": [{"name": "motor 1", "level": 2}] * 3})
    huge = whole[:16] + b"\xff\xff\xff\x7f" + whole[20:]
    for payload in (b"", whole[:-5], huge, *(whole[:n] for n in range(0, len(whole), 7))):
        robot.send_bytes(payload)
    robot.send({"name": "motor 1", "level": 2})
    assert {entry.name for entry in robot.entries} <= {"motor 1"}
    assert robot.entries[-1].level == 2
    assert MAX_QUEUED > 1


def test_a_fault_catalogue_has_texts_and_actions_by_code(tmp_path: Path) -> None:
    catalogue = "code,text,text:ja,cause,action,action:ja\nE1,Axis hot,軸過熱,Fan,Clean it,掃除する\n"
    (tmp_path / "faults.csv").write_text(catalogue)
    robot = received(tmp_path, FAULTS + 'catalogue = "faults.csv"\n')
    robot.send(
        {"hardware_id": "E1", "message": "?", "level": 2},
        {"hardware_id": "E9", "message": "Other", "level": 1},
        topic="faults",
    )
    known, other = robot.entries
    assert (render(known.text, "ja"), render(known.action, "ja")) == ("軸過熱", "掃除する")
    assert (render(known.cause, "de"), known.priorities) == ("Fan", (1,))
    assert (other.text, other.action, other.priorities) == ("Other", "", (3,))


def test_a_long_list_is_passed_on_in_parts_and_is_whole_with_the_last(tmp_path: Path) -> None:
    robot = received(tmp_path, FAULTS)
    count = 2 * CHUNK + 1
    robot.send(
        *({"hardware_id": f"E{i}", "message": "Hot", "level": 2} for i in range(count)), topic="faults"
    )
    assert len(robot.entries) == count
    assert robot.whole == [False, False, True]
    assert robot.earlier == {f"E{i}" for i in range(2 * CHUNK)}


def test_a_status_that_is_the_same_again_is_the_same_entry(tmp_path: Path) -> None:
    robot = received(tmp_path, HEALTH)
    for load, level in (("1 %", 0), ("2 %", 0), ("3 %", 2), ("3 %", 2), ("4 %", 2)):
        values = [{"key": "load", "value": load}]
        robot.send({"name": "motor 1", "level": level, "message": "Warm", "values": values})
    first, second, third, fourth, fifth = robot.entries
    assert first is second
    assert third is fourth
    assert (third.details, fifth.details) == ("load: 3 %", "load: 4 %")


def test_after_a_message_that_can_not_be_passed_on_the_next_one_counts(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    robot = received(tmp_path, HEALTH)
    robot.fails = True
    robot.send({"name": "motor 1", "level": 2, "message": "Hot"})
    assert "health: a message could not be read as alarms" in caplog.text
    robot.fails = False
    robot.send({"name": "motor 1", "level": 2, "message": "Burnt"})
    assert [entry.text for entry in robot.entries] == ["Burnt"]


HOT = {"name": "motor 7", "level": 2, "message": "Hot"}
WELL = {"name": "motor 7", "level": 0, "message": "OK"}
WARM = {"name": "motor 7", "level": 1, "message": "Warm"}
OTHERS = [{"name": f"motor {number}", "level": 0} for number in range(100, 100 + CHUNK)]


@pytest.mark.parametrize(
    ("statuses", "level", "count"),
    [
        ([HOT, WELL], 2, 2),
        ([WELL, HOT], 2, 2),
        ([HOT, *OTHERS, WELL], 2, 2),
        ([WARM, HOT, WARM], 2, 3),
        ([WELL, WELL], 0, 0),
        ([HOT], 2, 0),
    ],
)
def test_the_most_urgent_of_the_entries_of_one_name_counts(
    tmp_path: Path, statuses: list[Mapping[str, Any]], level: int, count: int
) -> None:
    robot = received(tmp_path, HEALTH)
    for _ in range(2):
        robot.entries.clear()
        robot.send(*statuses)
        (entry,) = [entry for entry in robot.entries if entry.name == "motor 7"]
        assert entry.level == level
        assert (f"{count} entries have this name" in render(entry.details)) == (count > 0)


def test_the_most_urgent_priority_of_a_code_counts(tmp_path: Path) -> None:
    robot = received(tmp_path, FAULTS)
    high, low = ({"hardware_id": "E1", "message": "hot", "level": level} for level in (2, 1))
    for statuses in ((high, low), (low, high)):
        robot.entries.clear()
        robot.send(*statuses, topic="faults")
        assert [(entry.name, entry.priorities) for entry in robot.entries] == [("E1", (1,))]


FIT = ["E1", "/arm/motor: temp", "Ölstand 80 % ?#&", "C:\\x", "油圧"]
UNFIT = [
    "E1\nhot", "E1\r", "a\tb", " E1", "E1 ", "", "..", "a/../b", "a//b", "a/", "a/.", "\u202eE1",
    "E1~0123456789ab", "x" * 161, "x" * 300 + "1", "x" * 300 + "2", "\x00", "\ud800", "/",
]  # fmt: skip


def test_each_name_has_an_id_of_its_own_that_a_path_takes() -> None:
    names = [entry_name(name) for name in FIT]
    assert names == FIT
    unfit = [entry_name(name) for name in UNFIT]
    assert len({*names, *unfit}) == len(FIT) + len(UNFIT)
    for name in unfit:
        assert len(name) <= LONGEST_ENTRY_NAME
        assert name.isprintable()
        path = urlsplit(urljoin("http://panel/alarms/", quote(f"faults:{name}") + "/acknowledge")).path
        assert unquote(path) == f"/alarms/faults:{name}/acknowledge"


@given(st.text(max_size=400), st.text(max_size=400))
def test_names_are_compared_whole(first: str, second: str) -> None:
    assert (entry_name(first) == entry_name(second)) == (first == second)

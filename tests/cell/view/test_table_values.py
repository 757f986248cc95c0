"""What a table shows: rows of the newest message, or the latest entry of each key; sorted, counted."""

import asyncio
from collections.abc import Callable, Mapping
from typing import Any, Final

import pytest

from app.cell.robot.state import RobotState, Sample
from app.cell.robot.tables import MAX_KEYS, MAX_QUEUED, NO_ROWS
from app.cell.view.view import build_view
from app.panel import Panel
from tests.support.builders import BRIDGE, INTERFACES, NOW, panel_of, robot_there
from tests.support.words import english

ARRAY: Final = "diagnostic_msgs/msg/DiagnosticArray"
LEVELS: Final = [
    {"value": 0, "text": "OK", "shape": "circle"},
    {"value": 1, "text": "Warning", "shape": "triangle", "colour": "yellow"},
]
TABLE: Final = {
    "id": "parts",
    "kind": "table",
    "label": "Parts",
    "topic": "/diagnostics",
    "type": ARRAY,
    "field": "status",
    "rows_shown": 2,
    "column": [
        {"label": "Level", "field": "level", "states": LEVELS},
        {"label": "Part", "field": "name"},
        {"label": "Heat", "field": "values[key=heat].value"},
    ],
}


def status(name: str, level: int = 0, **values: str) -> dict[str, Any]:
    listed = [{"key": key, "value": value} for key, value in values.items()]
    return {"level": level, "name": name, "message": "", "hardware_id": "", "values": listed}


class Robot:
    """A robot with the table, which hears messages one by one."""

    def __init__(self, on_decoded: Callable[[str], None] = lambda _: None, /, **more: Any) -> None:
        self.panel: Panel = panel_of({**TABLE, **more})
        self.state: RobotState = robot_there(self.panel, on_entries_decoded=on_decoded)
        self.seq = 0

    def says(self, *entries: Mapping[str, Any], at: float = NOW) -> None:
        self.hears(INTERFACES.encode(ARRAY, {"status": list(entries)}), at)

    def hears(self, payload: bytes, at: float = NOW) -> None:
        self.seq += 1
        sample = Sample(payload, self.seq, at, at, BRIDGE)
        self.state.update("diagnostics", sample)
        self.state.table_entries.record_sample("diagnostics", sample)

    def shown(self, now: float = NOW) -> Any:
        return english(build_view(self.panel, self.state, now).view["widgets"]["parts"])

    def names(self, now: float = NOW) -> list[str]:
        return [row["cells"][1]["text"] for row in self.shown(now)["table_rows"]]


def test_rows_are_the_entries_of_the_newest_message() -> None:
    robot = Robot()
    assert (robot.shown()["state"], robot.shown()["said"]) == ("waiting", "")
    robot.says(status("a"), status("b", 1, heat="48"), status("c"))
    view = robot.shown()
    assert (view["state"], view["said"]) == ("live", "and 1 more")
    ok, warning = (row["cells"] for row in view["table_rows"])
    assert ok == [
        {"text": "OK", "shape": "circle", "colour": "grey"},
        {"text": "a", "shape": "", "colour": ""},
        {"text": "—", "shape": "", "colour": ""},
    ]
    assert warning[0] == {"text": "Warning", "shape": "triangle", "colour": "yellow"}
    assert warning[2]["text"] == "48"
    robot.says(status("d"))
    assert robot.names() == ["d"]


def test_a_list_that_is_empty_says_so() -> None:
    robot = Robot()
    robot.says()
    view = robot.shown()
    assert (view["state"], view["said"], view["table_rows"]) == ("live", "No entries", [])


def test_entries_that_are_not_read_are_counted() -> None:
    robot = Robot(entries_read=3)
    robot.says(*(status(f"p{number}") for number in range(9)))
    assert (robot.names(), robot.shown()["said"]) == (["p0", "p1"], "and 1 more; 6 not read")
    robot = Robot(entries_read=2)
    robot.says(*(status(f"p{number}") for number in range(9)))
    assert robot.shown()["said"] == "7 entries not read"


WORST_FIRST: Final = {"first": "largest", "by": "level"}


@pytest.mark.parametrize("key", [None, "name"])
@pytest.mark.parametrize(("count", "bad"), [(120, 100), (300, 250), (2000, 1999)])
def test_the_worst_of_many_entries_is_the_first_row(count: int, bad: int, key: str | None) -> None:
    more = {"sort": WORST_FIRST} | ({"key": key} if key else {})
    robot = Robot(**more)
    robot.says(*(status(f"p{number}", 1 if number == bad else 0) for number in range(count)))
    assert robot.names() == [f"p{bad}", "p0"]
    assert robot.shown()["said"] == f"and {count - 2} more"


def test_in_the_order_of_the_list_abnormal_entries_below_the_rows_are_counted() -> None:
    robot = Robot()
    robot.says(*(status(f"p{number}", int(number in (1, 70, 99))) for number in range(100)))
    assert robot.names() == ["p0", "p1"]
    assert robot.shown()["said"] == "and 98 more: 2 × Warning"
    robot = Robot(entries_read=80)
    robot.says(*(status(f"p{number}", int(number in (1, 70, 99))) for number in range(100)))
    assert robot.shown()["said"] == "and 78 more: 1 × Warning; 20 not read"


def test_values_of_each_entry_are_its_own() -> None:
    """Keys inside of entries, and entries that lack them."""
    robot = Robot(rows_shown=4)
    third = status("c", cold="0", heat="3")
    robot.says(status("a", heat="1"), status("b"), third, status("d", heat="4"))
    assert [row["cells"][2]["text"] for row in robot.shown()["table_rows"]] == ["1", "—", "3", "4"]


@pytest.mark.parametrize(
    ("sort", "names"),
    [
        ({"first": "largest", "by": "level"}, ["b", "c"]),
        ({"first": "smallest", "by": "name"}, ["a", "b"]),
        ({"first": "newest"}, ["c", "b"]),
    ],
)
def test_entries_are_sorted(sort: Any, names: list[str]) -> None:
    robot = Robot(sort=sort)
    robot.says(status("a", 0), status("b", 2), status("c", 1))
    assert robot.names() == names


def test_a_key_keeps_the_latest_entry_of_each_part() -> None:
    robot = Robot(key="name", rows_shown=5, max_age_s=10.0)
    robot.says(status("a"), status("b", 1))
    robot.says(status("c"), at=NOW + 1)
    robot.says(status("a", 1), at=NOW + 2)
    view = robot.shown(NOW + 2)
    assert robot.names(NOW + 2) == ["a", "b", "c"]
    assert [row["cells"][0]["text"] for row in view["table_rows"]] == ["Warning", "Warning", "OK"]
    assert [row["age"] for row in robot.shown(NOW + 11)["table_rows"]] == ["", "11 s old", "10 s old"]
    assert build_view(robot.panel, robot.state, NOW + 2).displays["parts"] == NOW + 10
    assert robot.shown(NOW + 13)["state"] == "old"


def test_the_newest_of_several_messages_come_first() -> None:
    robot = Robot(key="name", sort={"first": "newest"})
    robot.says(status("a"))
    robot.says(status("b"), at=NOW + 1)
    robot.says(status("a"), at=NOW + 2)
    assert robot.names() == ["a", "b"]


def test_kept_entries_are_bounded() -> None:
    robot, step = Robot(key="name", rows_shown=1), 1000
    for first in range(0, 2 * MAX_KEYS, step):
        robot.says(*(status(f"p{first + number}") for number in range(step)), at=NOW + first)
    assert robot.names() == [f"p{MAX_KEYS}"]
    assert robot.shown()["said"] == f"and {MAX_KEYS - 1} more; {step} not read"


def test_messages_wait_in_a_bounded_queue_and_the_view_is_notified_when_they_are_decoded() -> None:
    decoded: list[str] = []
    robot = Robot(decoded.append, key="name")
    entries = robot.state.table_entries

    async def flood() -> None:
        for number in range(3 * MAX_QUEUED):
            robot.says(status(f"q{number}"))
        assert (entries.rows("parts"), decoded) == (NO_ROWS, [])
        while entries.rows("parts").hidden < MAX_QUEUED - 2:
            await asyncio.sleep(0)

    asyncio.run(asyncio.wait_for(flood(), 10))
    kept = [entry.values[1] for entry in entries.rows("parts").first]
    assert kept == [f"q{number}" for number in range(2 * MAX_QUEUED, 2 * MAX_QUEUED + 2)]
    assert set(decoded) == {"diagnostics"}


def test_damaged_bytes_take_no_row_away() -> None:
    robot = Robot(key="name")
    robot.says(status("a"))
    robot.hears(b"\0\1\0\0damaged")
    assert robot.shown()["state"] == "unreadable"
    robot.says(status("b"))
    assert (robot.shown()["state"], robot.names()) == ("live", ["a", "b"])


def test_a_list_of_single_values() -> None:
    table = {
        **TABLE,
        "topic": "/cells",
        "type": "sensor_msgs/msg/BatteryState",
        "field": "cell_voltage",
        "column": [{"label": "Voltage", "format": ".2f", "unit": "V"}],
    }
    panel = panel_of(table)
    robot = robot_there(panel)
    payload = INTERFACES.encode("sensor_msgs/msg/BatteryState", {"cell_voltage": [3.5, 3.625]})
    robot.update("cells", Sample(payload, 1, NOW, NOW, BRIDGE))
    robot.table_entries.record_sample("cells", Sample(payload, 1, NOW, NOW, BRIDGE))
    view: Any = english(build_view(panel, robot, NOW).view["widgets"]["parts"])
    rows = view["table_rows"]
    assert [row["cells"][0]["text"] for row in rows] == ["3.50 V", "3.62 V"]

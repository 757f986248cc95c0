"""The cells of a wall, from tokens and summaries: pure, with times of the test."""

from typing import Any, Final

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.cell.site.cells import KEPT_S, SILENT_S, TWIN_S, CellFilter, CellTable, WallCell, natural
from app.ros.zenoh.site import CellChanges
from tests.support.cells import alarm, payload

WALL: Final = 1_790_000_000.0


class Stage:
    """A table and its time."""

    def __init__(self, most: int = 2_000) -> None:
        self.table, self.now = CellTable(most), 100.0

    def take(self, changes: CellChanges) -> None:
        for _ in self.table.apply(changes, self.now, WALL + self.now):
            pass
        self.table.advance(self.now, WALL + self.now)

    def token(self, site: str, cell: str, alive: bool = True) -> None:
        self.take(CellChanges(alive={(site, cell): alive}))

    def say(self, site: str, cell: str, kind: str = "running", **changes: Any) -> None:
        self.hear(site, cell, payload(site, cell, kind, **changes))

    def hear(self, site: str, cell: str, *contents: bytes) -> None:
        of_cell = {str(by): content for by, content in enumerate(contents)}
        self.take(CellChanges(payloads={(site, cell): of_cell}))

    def after(self, seconds: float) -> None:
        self.now += seconds
        self.take(CellChanges())

    @property
    def first(self) -> WallCell:
        return self.table.cells[0]

    @property
    def kind(self) -> str:
        return self.first.kind


def test_a_cell_is_there_from_its_token_on_and_waits_for_data() -> None:
    stage = Stage()
    stage.token("line 2", "cell 1")
    assert (stage.first.kind, stage.table.waiting) == ("unknown", [("line 2", "cell 1")])
    stage.say("line 2", "cell 1", "fault")
    assert (stage.first.kind, stage.table.waiting) == ("fault", [])


def test_places_are_in_natural_order_whatever_the_state_is() -> None:
    stage = Stage()
    for cell in ("cell 10", "Cell 2", "cell 1"):
        stage.say("b", cell)
    stage.say("a", "z", "fault")
    before = [cell.name for cell in stage.table.cells]
    assert before == ["z", "cell 1", "Cell 2", "cell 10"]
    stage.say("b", "cell 10", "fault")
    stage.token("b", "cell 1", alive=False)
    assert [cell.name for cell in stage.table.cells] == before
    assert stage.table.counts() == {"fault": 2, "lost": 1, "running": 1}


def test_a_cell_that_went_is_shown_for_an_hour_since_when() -> None:
    stage = Stage()
    stage.say("a", "1", alarm_list=[alarm(2, "Air low")])
    stage.token("a", "1", alive=False)
    assert (stage.first.kind, stage.first.lost_at, stage.first.lost_wall) == ("lost", 100.0, WALL + 100)
    assert stage.table.totals.listed[0].alarm.text == "Air low"  # what is known of it stays
    stage.after(KEPT_S)
    assert stage.first.kind == "lost"
    stage.after(1)
    assert stage.table.cells == ()


def test_a_cell_that_says_nothing_is_not_reached_though_its_token_is_there() -> None:
    stage = Stage()
    stage.token("a", "1")
    stage.say("a", "1")
    stage.after(SILENT_S)
    assert stage.kind == "running"
    stage.after(1)
    assert stage.kind == "lost"
    stage.say("a", "1")
    assert (stage.first.kind, stage.first.lost_at) == ("running", None)


def test_after_a_change_of_routers_old_values_are_not_shown_as_new() -> None:
    stage = Stage()
    stage.token("a", "1")
    stage.say("a", "1")
    stage.token("a", "1", alive=False)
    stage.after(3)
    stage.token("a", "1")
    assert stage.table.waiting == [("a", "1")]
    # A token that goes and comes between two looks is none that went.
    stage.say("a", "1")
    version = stage.first.version
    stage.take(CellChanges(alive={("a", "1"): True}))
    assert stage.first.version == version


def test_a_wall_without_a_router_shows_no_cell_as_reached() -> None:
    stage = Stage()
    for cell in "123":
        stage.say("a", cell)
    stage.table.lose_all(stage.now, WALL)
    assert stage.table.counts() == {"lost": 3}


def test_two_cells_with_one_name_are_named() -> None:
    stage = Stage()
    first, other = (payload("a", "1", instance=name) for name in ("i1", "i2"))
    stage.hear("a", "1", first, other)
    assert stage.first.has_twin
    # Started again: the old instance is gone.
    stage.after(TWIN_S - 1)
    stage.hear("a", "1", other)
    stage.after(2)
    assert not stage.first.has_twin
    stage.say("a", "1", twin="https://other.example/", instance="i2")
    assert stage.first.has_twin


@pytest.mark.parametrize(
    "content", [b"", b"{}", payload("a", "2"), payload("a", "1", url="javascript:alert(1)")]
)
def test_a_summary_that_can_not_be_read_is_said_and_shows_nothing_of_it(content: bytes) -> None:
    stage = Stage()
    stage.say("a", "1")
    stage.hear("a", "1", content)
    assert stage.first.kind == "unknown"
    assert stage.first.fault
    assert stage.first.summary is not None
    assert stage.first.summary.url == "https://1.plant.example/"
    stage.say("a", "1")
    assert (stage.first.kind, stage.first.fault) == ("running", "")


def test_more_cells_than_there_is_room_for_are_counted() -> None:
    stage = Stage(most=3)
    for number in range(10):
        stage.token("a", f"cell {number}")
    assert (len(stage.table.cells), stage.table.left_out) == (3, 7)
    stage.take(CellChanges(dropped=1_000_000))
    assert (len(stage.table.cells), stage.table.left_out) == (3, 1_000_007)
    # One that is not reached gives its room.
    stage.token("a", "cell 1", alive=False)
    stage.token("b", "new")
    assert [cell.name for cell in stage.table.cells] == ["cell 0", "cell 2", "new"]


@pytest.mark.parametrize("name", ["", "@cell", "a" * 65, " a", "a\n", "a*"])
def test_a_name_that_is_none_is_left_out(name: str) -> None:
    stage = Stage()
    stage.token("a", name)
    assert (stage.table.cells, stage.table.left_out) == ((), 1)


def test_what_is_the_same_but_for_its_time_changes_nothing() -> None:
    stage = Stage()
    stage.say("a", "1")
    version = stage.table.version
    stage.say("a", "1", at="2026-11-25T14:50:00.000+00:00")
    assert stage.table.version == version
    stage.say("a", "1", "waiting")
    assert stage.table.version == version + 1


def test_alarms_of_all_cells_stand_with_the_unacknowledged_first() -> None:
    stage = Stage()
    stage.say("a", "1", alarm_list=[alarm(3, "low"), alarm(1, "seen", acknowledged=True)])
    stage.say("a", "2", alarm_list=[alarm(2, "new", since="2026-11-25T15:00:00.000+00:00")])
    stage.say("a", "3", alarm_list=[alarm(2, "old")])
    totals = stage.table.totals
    assert [each.alarm.text for each in totals.listed] == ["new", "old", "low", "seen"]
    assert (totals.standing, totals.unacknowledged) == (4, 4)


def test_a_filter_lists_by_name_and_greys_out_by_state() -> None:
    stage = Stage()
    stage.say("line 1", "north", "fault")
    stage.say("line 2", "south")
    north, south = stage.table.cells
    assert [CellFilter(text=" NORTH ").lists(cell) for cell in (north, south)] == [True, False]
    assert [CellFilter(text="line").lists(cell) for cell in (north, south)] == [True, True]
    assert [CellFilter(site="line 2").lists(cell) for cell in (north, south)] == [False, True]
    assert [CellFilter(show="abnormal").dims(cell) for cell in (north, south)] == [False, True]
    assert [CellFilter(show="alarms").dims(cell) for cell in (north, south)] == [True, True]


@given(st.lists(st.text(max_size=12), max_size=6))
def test_any_names_have_an_order(names: list[str]) -> None:
    assert sorted(sorted(names, key=natural), key=natural) == sorted(names, key=natural)


def test_alarms_are_counted_by_priority_and_the_oldest_word_by_its_age() -> None:
    stage = Stage()
    assert stage.table.oldest_s(stage.now) == 0.0
    stage.say("line 1", "one", alarm_list=[alarm(1, "a"), alarm(3, "b")])
    stage.after(4.0)
    stage.say("line 1", "two", alarm_list=[alarm(1, "c")], unacknowledged=dict.fromkeys("1234", 0))
    assert stage.table.alarms_by_priority == {"1": (1, 1), "2": (0, 0), "3": (0, 1), "4": (0, 0)}
    assert stage.table.oldest_s(stage.now + 1) == 5.0
    stage.token("line 1", "one", alive=False)
    assert stage.table.oldest_s(stage.now + 1) == 1.0, "of those that are reached"

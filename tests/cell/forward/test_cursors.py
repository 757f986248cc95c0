"""Where a stream goes on after the centre or the cell was restored, replaced or emptied."""

from collections.abc import Callable, Mapping

import pytest

from app.cell.forward.cursors import Position, Resumption, resume
from app.cell.forward.spool import Cursor
from app.cell.forward.streams import Mark

Rows = Mapping[int, str]  # number → hash


def up_to(last: int, word: str = "a", first: int = 1) -> Rows:
    return {seq: f"{word}{seq}" for seq in range(first, last + 1)}


def resumed(sent: Cursor | None, centre: Rows, cell: Rows, generation: int = 0) -> Resumption:
    known = None
    if centre:
        last = max(centre)
        known = Position(generation, last, Mark(last, centre[last]))

    def cell_row(seq: int) -> tuple[int, Mark] | None:
        there = [number for number in cell if number <= seq]
        return (max(there), Mark(max(there), cell[max(there)])) if there else None

    def centre_row(in_generation: int, seq: int) -> Mark | None:
        assert in_generation == generation
        return Mark(seq, centre[seq]) if seq in centre else None

    return resume(sent, known, min(cell), max(cell), cell_row, centre_row)


@pytest.mark.parametrize(
    ("sent", "centre", "cell", "expected"),
    [
        pytest.param(None, {}, up_to(9), (Cursor(0, 0), True, False), id="first time"),
        pytest.param(None, {}, up_to(9, first=5), (Cursor(0, 4), True, False), id="older gone"),
        pytest.param(Cursor(0, 7), up_to(7), up_to(9), (Cursor(0, 7), False, False), id="goes on"),
        pytest.param(None, up_to(7), up_to(9), (Cursor(0, 7), False, False), id="own note lost"),
        pytest.param(Cursor(0, 5), up_to(7), up_to(9), (Cursor(0, 7), False, False), id="answer lost"),
        pytest.param(Cursor(0, 9), up_to(4), up_to(9), (Cursor(0, 4), False, True), id="restored"),
        pytest.param(Cursor(0, 9), {}, up_to(9), (Cursor(0, 0), True, True), id="centre emptied"),
        pytest.param(
            Cursor(0, 9), up_to(3), up_to(9, first=6), (Cursor(0, 3), False, True),
            id="centre restored, rows gone",
        ),
        pytest.param(
            Cursor(0, 4), up_to(4), up_to(9, first=8), (Cursor(0, 4), False, False), id="long outage"
        ),
        pytest.param(
            Cursor(0, 9), up_to(9), {**up_to(5), **up_to(8, "b", 6)}, (Cursor(1, 5), True, False),
            id="cell restored",
        ),
        pytest.param(
            Cursor(0, 6), up_to(6), {**up_to(4), **up_to(12, "b", 5)}, (Cursor(1, 4), True, False),
            id="cell restored and grown",
        ),
        pytest.param(
            Cursor(0, 9), up_to(9), up_to(3, "b"), (Cursor(1, 0), True, False), id="cell replaced"
        ),
        pytest.param(None, up_to(9), up_to(30, "b"), (Cursor(1, 0), True, False), id="new store"),
        pytest.param(
            Cursor(0, 9), up_to(9), up_to(5), (Cursor(1, 5), True, False), id="newest rows lost"
        ),
    ],
)  # fmt: skip
def test_the_centre_s_last_row_decides(
    sent: Cursor | None, centre: Rows, cell: Rows, expected: tuple[Cursor, bool, bool]
) -> None:
    assert tuple(resumed(sent, centre, cell)) == expected


def test_a_sparse_stream_is_compared_by_the_rows_that_it_has() -> None:
    cell = {3: "a3", 17: "a17", 40: "b40", 55: "b55"}
    where = resumed(Cursor(2, 48), {3: "a3", 17: "a17", 48: "a48"}, cell, generation=2)
    assert where == Resumption(Cursor(3, 17), begins=True)


def test_the_last_common_row_is_found_in_a_few_steps() -> None:
    asked: list[int] = []
    rows = up_to(100_000)

    def mark(own: bool) -> Callable[[int], Mark]:
        return lambda seq: Mark(seq, rows[seq] if own or seq <= 70_000 else "other")

    def centre_row(_: int, seq: int) -> Mark:
        asked.append(seq)
        return mark(False)(seq)

    known = Position(0, 100_000, Mark(100_000, "other"))
    where = resume(None, known, 1, 100_000, lambda seq: (seq, mark(True)(seq)), centre_row)
    assert where.cursor == Cursor(1, 70_000)
    assert len(asked) < 20


def test_a_time_that_the_database_has_rounded_is_the_same_row() -> None:
    assert Mark(1000).fits(Mark(1001))
    assert not Mark(1000).fits(Mark(1002))
    assert Mark(1, "x").fits(Mark(2, "x"))
    assert not Mark(1, "x").fits(Mark(1, "y"))

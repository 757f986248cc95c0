"""Where a stream goes on: the cell's store is compared with what the centre has. Pure, but for the
two functions that read a row of each side.

The centre's last row decides. A centre that was restored from a copy is behind, so the stream goes
back. Where the cell's row with that number is another one, the cell's store was replaced or restored:
the rows from there on get a new generation, so that none takes the number of another.
"""

from collections.abc import Callable
from typing import NamedTuple

from app.cell.forward.spool import Cursor
from app.cell.forward.streams import Mark


class Position(NamedTuple):
    """The last row of a stream at the centre."""

    generation: int
    seq: int
    mark: Mark


class Resumption(NamedTuple):
    """After which row a stream goes on. `begins`: with a generation that the centre does not know yet.
    `went_back`: rows that were sent before are sent again."""

    cursor: Cursor
    begins: bool = False
    went_back: bool = False


# The last row of the cell up to a number, with its number; None without one.
CellRow = Callable[[int], tuple[int, Mark] | None]
# A row of the centre by generation and number; None without one.
CentreRow = Callable[[int, int], Mark | None]


def resume(
    sent: Cursor | None,
    known: Position | None,
    first: int,
    last: int,
    cell_row: CellRow,
    centre_row: CentreRow,
) -> Resumption:
    """`sent` is the cell's own note of how far it was, None without one; `known` the last row of the
    centre, None if it has none; `first` and `last` are the numbers of the cell's rows, of which there
    is at least one."""
    if known is None:
        return Resumption(Cursor(0, first - 1), begins=True, went_back=sent is not None)
    own = cell_row(known.seq)
    behind = sent is not None and sent.generation == known.generation and sent.seq > known.seq
    here = Cursor(known.generation, known.seq)
    if own is not None and own[0] == known.seq and own[1].fits(known.mark):
        return Resumption(here, went_back=behind)
    if known.seq < first:  # the cell has removed that row since
        oldest = cell_row(first)
        if behind or sent == here or (oldest is not None and oldest[1].at >= known.mark.at):
            return Resumption(here, went_back=behind)
    common = _last_common(known, first, last, cell_row, centre_row)
    return Resumption(Cursor(known.generation + 1, common or first - 1), begins=True)


def _last_common(
    known: Position, first: int, last: int, cell_row: CellRow, centre_row: CentreRow
) -> int:
    """The number of the last row that both sides have, 0 for none: from it on they differ."""
    low, high, common = first - 1, min(last, known.seq), 0
    while low < high:
        middle = (low + high + 1) // 2
        row = cell_row(middle)
        if row is None or row[0] <= low:  # no row between
            low = middle
            continue
        mark = centre_row(known.generation, row[0])
        if mark is not None and row[1].fits(mark):
            low, common = middle, row[0]
        else:
            high = row[0] - 1
    return common

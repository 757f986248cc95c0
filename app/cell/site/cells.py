"""The cells of a wall: made of tokens and summaries alone, in a fixed order. Pure, with injected time.

A cell that went stays for an hour, as one without contact.
"""

import hashlib
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Final, Literal, NamedTuple, get_args

from app.cell.site.summary import EVERY_S, Kind, Priority, ReadAlarm, Summary, read_summary
from app.panel.rules import CHUNK
from app.ros.zenoh.site import CellChanges
from app.system.errors import InputError

MAX_CELLS: Final = 2_000
KEPT_S: Final = 3_600.0  # a cell without contact
SILENT_S: Final = 3 * EVERY_S  # a cell that says nothing for so long is not reached
TWIN_S: Final = 4 * EVERY_S  # two publishers of one name within this time are two cells
AT_ONCE: Final = 100  # summaries that are read without a pause
LISTED_ALARMS: Final = 40

# `lost`: the wall has no contact with the cell.
TileKind = Kind | Literal["lost"]
TILE_KINDS: Final[tuple[TileKind, ...]] = ("running", "waiting", "manual", "fault", "unknown", "lost")
CHUNKS: Final = re.compile(CHUNK)
DIGITS: Final = re.compile(r"(\d+)")
Names = tuple[str, str]


def natural(name: str) -> tuple[tuple[int, str], ...]:
    """A key to sort names by: "cell 2" before "cell 10"."""
    parts = DIGITS.split(name.casefold())
    return tuple((int(part[:18]), "") if part.isdecimal() else (0, part) for part in parts if part)


@dataclass(slots=True, eq=False)
class WallCell:
    """A cell. `heard_at` is when its last summary arrived (monotonic seconds), `lost_at` and
    `lost_wall` since when it is not reached, None while it is. `fault` is why its last summary can't be
    read. `publishers` are the instances that publish with its name, with the time of their last
    word."""

    site: str
    name: str
    id: str
    came_at: float
    summary: Summary | None = None
    alive: bool = False
    heard_at: float | None = None
    lost_at: float | None = None
    lost_wall: float = 0.0
    fault: str = ""
    publishers: dict[str, float] = field(default_factory=dict)
    version: int = 0

    @property
    def kind(self) -> TileKind:
        if self.lost_at is not None:
            return "lost"
        return self.summary.state.kind if self.summary and not self.fault else "unknown"

    @property
    def alarms(self) -> Sequence[ReadAlarm]:
        return self.summary.alarm_list if self.summary else ()

    @property
    def has_twin(self) -> bool:
        """Whether several cells have this name."""
        return len(self.publishers) > 1 or bool(self.summary and self.summary.twin)

    @property
    def highest(self) -> int:
        """The priority of its most urgent alarm; 0 for none."""
        counts = self.summary.alarms if self.summary else {}
        return min((int(priority) for priority, count in counts.items() if count), default=0)


class CellAlarm(NamedTuple):
    cell: WallCell
    alarm: ReadAlarm


class AlarmTotals(NamedTuple):
    """Of all cells."""

    listed: Sequence[CellAlarm]
    standing: int
    unacknowledged: int


class CellTable:
    """`version` is incremented at each change of what is shown, `order` when cells come or go.
    `left_out` is how many cells found no room, or have a name that is none."""

    def __init__(self, most: int = MAX_CELLS) -> None:
        self._most = most
        self._cells: dict[Names, WallCell] = {}
        self._sorted: tuple[WallCell, ...] | None = ()
        self._totals: AlarmTotals | None = None
        self.version = 0
        self.order = 0
        self.left_out = 0

    @property
    def cells(self) -> tuple[WallCell, ...]:
        """By site and name, in their natural order: the place of a cell never depends on its state."""
        if self._sorted is None:
            every = self._cells.values()
            self._sorted = tuple(sorted(every, key=lambda c: (natural(c.site), natural(c.name), c.id)))
        return self._sorted

    @property
    def sites(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys(cell.site for cell in self.cells))

    def find(self, cell_id: str) -> int | None:
        """The place of a cell in `cells`."""
        return next((at for at, cell in enumerate(self.cells) if cell.id == cell_id), None)

    def counts(self, cells: Iterable[WallCell] | None = None) -> Counter[TileKind]:
        return Counter(cell.kind for cell in (self._cells.values() if cells is None else cells))

    @property
    def totals(self) -> AlarmTotals:
        """The alarms of all cells: the unacknowledged first, by priority, then the newest."""
        if self._totals is None:
            of_all = [CellAlarm(cell, alarm) for cell in self._cells.values() for alarm in cell.alarms]
            of_all.sort(key=lambda each: each.alarm.since, reverse=True)
            of_all.sort(key=lambda each: (each.alarm.acknowledged, each.alarm.priority))
            summaries = [cell.summary for cell in self._cells.values() if cell.summary]
            standing = sum(sum(summary.alarms.values()) for summary in summaries)
            unacknowledged = sum(sum(summary.unacknowledged.values()) for summary in summaries)
            self._totals = AlarmTotals(of_all[:LISTED_ALARMS], standing, unacknowledged)
        return self._totals

    @property
    def alarms_by_priority(self) -> dict[str, tuple[int, int]]:
        """Of all cells: the acknowledged and the unacknowledged alarms of each priority."""
        standing, unacknowledged = Counter[str](), Counter[str]()
        for cell in self._cells.values():
            if cell.summary is not None:
                standing.update(cell.summary.alarms)
                unacknowledged.update(cell.summary.unacknowledged)
        return {
            priority: (max(0, standing[priority] - unacknowledged[priority]), unacknowledged[priority])
            for priority in get_args(Priority)
        }

    def oldest_s(self, now: float) -> float:
        """The age of the oldest summary of a cell that is reached, 0 without one."""
        heard = [cell.heard_at or cell.came_at for cell in self._cells.values() if cell.lost_at is None]
        return max(0.0, now - min(heard, default=now))

    @property
    def waiting(self) -> list[Names]:
        """The cells that live and have not said anything yet."""
        return [names for names, cell in self._cells.items() if cell.alive and cell.heard_at is None]

    # What has arrived.

    def apply(self, changes: CellChanges, now: float, wall: float) -> Iterator[None]:
        """Takes the changes; yields after every `AT_ONCE` summaries. Times are in monotonic seconds and
        in seconds since the epoch."""
        self.left_out += changes.dropped
        for names, alive in changes.alive.items():
            self._token(names, alive, now, wall)
        for done, (names, payloads) in enumerate(changes.payloads.items(), 1):
            for payload in payloads.values():
                self._summary(names, payload, now)
            if not done % AT_ONCE:
                yield

    def _token(self, names: Names, alive: bool, now: float, wall: float) -> None:
        cell = self._cells.get(names)
        if cell is None:
            if alive and (cell := self._new(names, now)) is not None:
                cell.alive = True
                self._changed(cell)
            return
        if not alive and cell.alive:
            self._lose(cell, now, wall)
        elif alive and not cell.alive:
            cell.alive = True
            if cell.lost_at is not None:  # what it said before is old: it says it again at once
                cell.lost_at, cell.heard_at, cell.came_at = None, None, now
            self._changed(cell)

    def _lose(self, cell: WallCell, now: float, wall: float) -> None:
        cell.alive = False
        if cell.lost_at is None:
            cell.lost_at, cell.lost_wall = now, wall
        cell.publishers.clear()
        self._changed(cell)

    def _summary(self, names: Names, payload: bytes, now: float) -> None:
        cell = self._cells.get(names) or self._new(names, now)
        if cell is None:
            return
        try:
            read = read_summary(payload, *names)
        except InputError as error:
            if cell.fault != str(error):
                cell.fault = str(error)
                self._changed(cell)
            cell.heard_at = now
            return
        cell.fault = ""
        cell.publishers[read.instance] = now
        cell.alive = True
        cell.lost_at = None
        before, cell.summary, cell.heard_at = cell.summary, read, now
        if before is None or before.model_copy(update={"at": read.at}) != read or cell.version == 0:
            self._changed(cell)

    def _new(self, names: Names, now: float) -> WallCell | None:
        """None if there is no room for it: one that is not reached gives its own."""
        if not all(CHUNKS.fullmatch(name) for name in names):
            self.left_out += 1
            return None
        if len(self._cells) >= self._most and not self._make_room():
            self.left_out += 1
            return None
        digest = hashlib.blake2s("/".join(names).encode(), digest_size=5).hexdigest()
        cell = self._cells[names] = WallCell(*names, f"c{digest}", now)
        self._reordered()
        return cell

    def _make_room(self) -> bool:
        lost = [cell for cell in self._cells.values() if cell.lost_at is not None]
        if not lost:
            return False
        oldest = min(lost, key=lambda cell: cell.lost_at or 0.0)
        del self._cells[oldest.site, oldest.name]
        return True

    # What time alone changes.

    def advance(self, now: float, wall: float) -> None:
        for cell in [*self._cells.values()]:
            if cell.lost_at is None:
                if now - (cell.heard_at or cell.came_at) > SILENT_S:
                    alive = cell.alive
                    self._lose(cell, now, wall)
                    cell.alive = alive  # its token is there: the next summary brings it back
                elif len(cell.publishers) > 1:
                    self._forget_publishers(cell, now)
            elif now - cell.lost_at > KEPT_S:
                del self._cells[cell.site, cell.name]
                self._reordered()

    def _forget_publishers(self, cell: WallCell, now: float) -> None:
        """A panel that was started again has another instance: the old one says nothing more."""
        recent = {name: at for name, at in cell.publishers.items() if now - at <= TWIN_S}
        if recent.keys() != cell.publishers.keys():
            cell.publishers = recent
            self._changed(cell)

    def lose_all(self, now: float, wall: float) -> None:
        """The wall itself has no connection."""
        for cell in self._cells.values():
            if cell.lost_at is None:
                self._lose(cell, now, wall)

    def _changed(self, cell: WallCell) -> None:
        self.version += 1
        cell.version = self.version
        self._totals = None

    def _reordered(self) -> None:
        self.version += 1
        self.order += 1
        self._sorted = self._totals = None


Shown = Literal["all", "abnormal", "alarms"]


@dataclass(frozen=True, slots=False)
class CellFilter:
    """What a page leaves out: it shows the cells of `site` ("" for all) with `text` in their name or
    site, and greys out those that are not `show`."""

    show: Shown = "all"
    site: str = ""
    text: str = ""

    @cached_property
    def _wanted(self) -> str:
        return self.text.casefold().strip()

    def lists(self, cell: WallCell) -> bool:
        if self.site and cell.site != self.site:
            return False
        return not self._wanted or self._wanted in f"{cell.site} {cell.name}".casefold()

    def dims(self, cell: WallCell) -> bool:
        return not CHOSEN[self.show](cell)


CHOSEN: Final[dict[Shown, Callable[[WallCell], bool]]] = {
    "all": lambda cell: True,
    "abnormal": lambda cell: cell.kind != "running",
    "alarms": lambda cell: cell.highest > 0,
}

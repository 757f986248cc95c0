"""The journal of changes: what the log and the alarms do not have of what stops a machine. Its state,
interlocks, conditions, the link, publishers and nodes, as they change.

Observed on the event loop at each step of a turn; written by a thread when something has changed.
"""

import asyncio
import json
import logging
import math
import sqlite3
import time
from collections import deque
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Literal, NamedTuple

from app.cell.alarms.records import text_of
from app.cell.permission.interlocks import link_verdict
from app.cell.robot.clocks import is_other_time
from app.cell.robot.state import RobotState, Sample
from app.cell.view.conditions import condition_row
from app.cell.view.displays import field_state, lamp_of
from app.panel.condition import NamedCondition
from app.panel.model import Panel
from app.panel.values import same_value
from app.records.database import as_log_error
from app.system.concurrency import keep_running
from app.system.errors import LogError
from app.system.limits import Quota, TokenBuckets
from app.system.texts import Text, TextLike

log = logging.getLogger("kiosk.stops")

ChangeSort = Literal["state", "interlock", "condition", "link", "publisher", "node", "clock"]


STOPPING_SORTS: Final[Collection[ChangeSort]] = ("state", "link")


class Change(NamedTuple):
    """A change at `at` (seconds since the epoch, when the panel received it). `sent` is the time that
    a peer of the robot put on it, on the panel's clock, None where that is not known; `clock` is the
    zid of the peer. `id` is that of the
    interlock or condition, or the name of a topic or node. `breaks`: it is not met, is lost, or is a
    state that is a stop; `heals`: that is over. Texts are JSON, "" for none. `seq` is 0 before it is
    written."""

    at: float
    sent: float | None
    robot: str
    sort: ChangeSort
    id: str
    breaks: bool
    heals: bool
    before: str = ""
    after: str = ""
    reason: str = ""
    clock: str = ""
    seq: int = 0


# Observes one robot.

PER_VALUE: Final = Quota(20, per_s=0.5)  # changes of one value that are recorded
MOST_AT_ONCE: Final = 50  # names of a sort in one step
CLOCK_SET_S: Final = 1.0  # by so much the panel's clock is set
STAMPED_LATE_S: Final = 0.001  # a stamp is no later than the arrival of its message


@dataclass(slots=True)
class _Watched:
    """A condition with what was known of it last, by a value of its field; `until` (monotonic seconds)
    is when time alone changes that. `is_known`: it has been met or not since the start."""

    condition: NamedCondition
    sort: ChangeSort
    met: str = ""
    value: TextLike = ""
    raw: Any = None
    until: float = -math.inf
    is_known: bool = False


@dataclass(slots=True)
class ChangeObserver:
    """Observes a robot from the first step of its turn on. A listener of samples too, for the times
    that its peer has put on them. `on_stop` is called when the state is a stop, or the link is lost.
    Used on the event loop only."""

    panel: Panel
    robot: RobotState
    journal: "ChangeJournal"
    on_stop: Callable[[], None] = lambda: None
    _watched: dict[str, list[_Watched]] = field(default_factory=dict)  # by the topic's key
    _samples: dict[tuple[str, float], Sample] = field(default_factory=dict)
    _unsent: list[tuple[str, Change]] = field(default_factory=list)
    _state: tuple[Any, TextLike] | None = None
    _is_linked: bool | None = None
    _missing: frozenset[str] = frozenset()
    _ended: frozenset[str] = frozenset()
    _until: float = -math.inf
    _clock_ahead: float | None = None

    def __post_init__(self) -> None:
        interlocks = {interlock.id for interlock in self.panel.interlocks}
        for condition in self.panel.named_conditions:
            if self.robot.named(condition.robot) in (self.robot, None):
                sort: ChangeSort = "interlock" if condition.id in interlocks else "condition"
                watched = _Watched(condition, sort)
                self._watched.setdefault(self.robot.key(condition.topic), []).append(watched)

    @property
    def keys(self) -> frozenset[str]:
        """The keys of the topics whose samples it gets."""
        state = self.panel.state
        return frozenset({*self._watched, *([self.robot.key(state.topic)] if state else [])})

    def record_sample(self, key: str, sample: Sample) -> None:
        """A sample was received, in this turn."""
        if sample.sent is not None:
            self._samples[key, sample.wall] = sample

    def step(self, topics: Collection[str], everything: bool) -> None:
        """A step of a turn: messages arrived on topics with these keys or, with `everything`, anything
        else has changed too."""
        now, wall = time.monotonic(), time.time()
        self._observe_clock(now, wall)
        if everything or now >= self._until:
            self._observe_graph(now, wall)
            topics = self.keys
        if not self._is_linked:
            return
        if self.panel.state is not None and self.robot.key(self.panel.state.topic) in topics:
            self._observe_state(now, wall)
        for key in topics:
            for watched in self._watched.get(key, ()):
                self._observe_condition(key, watched, now, wall)
        self._until = min(
            (each.until for every in self._watched.values() for each in every), default=math.inf
        )

    def finish(self) -> None:
        """The turn has ended: what was observed in it is recorded, with the stamps of its samples."""
        for key, change in self._unsent:
            sample = self._samples.get((key, change.at))
            sent = None if sample is None else self._on_own_clock(sample)
            if sample is not None and sent is not None:
                change = change._replace(sent=sent, clock=sample.source or "")
            self.journal.add(change)
            if change.breaks and change.sort in STOPPING_SORTS:
                self.on_stop()
        self._unsent.clear()
        self._samples.clear()

    def _on_own_clock(self, sample: Sample) -> float | None:
        """The stamp of a sample on the panel's clock; None where they can't be compared, as where the
        peer's clock was set: nothing arrives before it is sent."""
        ahead = self.robot.clock.peer_ahead(sample.source or "")
        if ahead is None or sample.sent is None or is_other_time(ahead):
            return None
        sent = sample.sent - ahead
        return sent if sent <= sample.wall + STAMPED_LATE_S else None

    def _observe_clock(self, now: float, wall: float) -> None:
        ahead = wall - now
        before, self._clock_ahead = self._clock_ahead, ahead
        if before is not None and abs(ahead - before) >= CLOCK_SET_S:
            by = f"{ahead - before:+.1f}"
            self._add("", Change(wall, None, self._id, "clock", "panel", False, False, after=by))

    @property
    def _id(self) -> str:
        return self.robot.id or ""

    def _observe_graph(self, now: float, wall: float) -> None:
        """The link, and the publishers and nodes that the panel needs."""
        verdict = link_verdict(self.robot, now)
        was, self._is_linked = self._is_linked, verdict.permitted
        if was is not None and was != verdict.permitted:
            reason = _as_json(verdict.reason or "")
            lost = not verdict.permitted
            self._add("", Change(wall, None, self._id, "link", "", lost, not lost, reason=reason))
        if not verdict.permitted:
            return
        missing = frozenset(self.robot.presence.missing(self.robot.graph))
        ended = frozenset(self.robot.presence.ended_nodes(self.robot.graph))
        self._add_names("publisher", self._missing, missing, wall)
        self._add_names("node", self._ended, ended, wall)
        self._missing, self._ended = missing, ended

    def _add_names(
        self, sort: ChangeSort, before: frozenset[str], after: frozenset[str], wall: float
    ) -> None:
        """Names of what is lost now, and of what is there again."""
        for name in sorted(before ^ after)[:MOST_AT_ONCE]:
            lost = name in after
            self._add("", Change(wall, None, self._id, sort, name, lost, not lost))

    def _observe_state(self, now: float, wall: float) -> None:
        rules = self.panel.state
        assert rules is not None  # its topic has a message
        display = rules.display
        shown = field_state(display, self.robot, now)
        if shown.state != "live":
            return
        text, _, _ = lamp_of(display.states, shown.value, self.robot.texts)
        before, self._state = self._state, (shown.value, text)
        if before is None or same_value(before[0], shown.value):
            return
        stops = rules.stop_values
        breaks, was_stop = (
            any(same_value(value, stop) for stop in stops) for value in (shown.value, before[0])
        )
        reading = self.robot.reading(rules.topic)
        change = Change(
            reading.wall, None, self._id, "state", str(shown.value), breaks and not was_stop,
            was_stop and not breaks, _as_json(before[1]), _as_json(text),
        )  # fmt: skip
        self._add(self.robot.key(rules.topic), change)

    def _observe_condition(self, key: str, watched: _Watched, now: float, wall: float) -> None:
        condition = watched.condition
        reading = self.robot.reading(condition.topic)
        fields = reading.fields if reading.status == "message" and not reading.keyed else None
        raw = None if fields is None else fields.get(condition.field)
        is_known = raw is not None and watched.met in ("met", "unmet")
        if is_known and raw == watched.raw and now < watched.until:
            return  # a message like the one before
        watched.raw = raw
        row = condition_row(condition, self.robot, now)
        watched.until = row.until
        was, value = watched.met, watched.value
        watched.met, watched.value = row.met, row.value
        if was in ("", "unknown") and not watched.is_known:
            watched.is_known = row.met != "unknown"
            return
        if was == row.met:
            return
        is_of_value = "unknown" not in (was, row.met)
        change = Change(
            reading.wall if is_of_value else wall, None, self._id, watched.sort, condition.id,
            row.met != "met" and was == "met", row.met == "met", _as_json(value), _as_json(row.value),
        )  # fmt: skip
        self._add(key if is_of_value else "", change)

    def _add(self, key: str, change: Change) -> None:
        self._unsent.append((key, change))


def _as_json(text: TextLike) -> str:
    if text == "":
        return ""
    return json.dumps(text.as_json() if isinstance(text, Text) else str(text), ensure_ascii=False)


def text_in_json(text: str) -> TextLike:
    """The text of a column; as it is written where it can't be read."""
    if not text:
        return ""
    try:
        return text_of(json.loads(text))
    except ValueError:
        return text


# The journal: a table in the file of the machine's states.

MAX_ROWS: Final = 50_000  # some 10 MB; the oldest go
MAX_WAITING: Final = 5_000  # that the disk has refused; the oldest go
TOGETHER_S: Final = 0.1  # changes within this time are written together
AGAIN_S: Final = 5.0
COLUMNS: Final = Change._fields[:-1]
SCHEMA: Final = """
CREATE TABLE IF NOT EXISTS changes (
    seq INTEGER PRIMARY KEY AUTOINCREMENT, at REAL NOT NULL, sent REAL, robot TEXT NOT NULL,
    sort TEXT NOT NULL, id TEXT NOT NULL, breaks INTEGER NOT NULL, heals INTEGER NOT NULL,
    before TEXT NOT NULL, after TEXT NOT NULL, reason TEXT NOT NULL,
    clock TEXT NOT NULL
);
CREATE INDEX IF NOT EXISTS changes_at ON changes (at);
"""


class ChangeJournal:
    """Writes the changes of all robots into a file, from `start` to `stop`. Used on the event loop
    only."""

    def __init__(self) -> None:
        self._path: Path | None = None
        self._waiting: deque[Change] = deque(maxlen=MAX_WAITING)
        self._buckets = TokenBuckets(PER_VALUE)
        self._has_changes = asyncio.Event()
        self._has_failed = False
        self._task: asyncio.Task[None] | None = None

    def add(self, change: Change) -> None:
        """Records a change, unless the same value changes too often."""
        name = (change.robot, change.sort, change.id)
        if not self._buckets.has_token(name):
            return
        self._buckets.take_token(name)
        self._waiting.append(change)
        self._has_changes.set()

    def start(self, path: Path) -> None:
        self._path = path
        self._task = keep_running(self._run, log, "recording changes failed")

    async def stop(self) -> None:
        """Writes what waits."""
        if self._task is not None:
            self._task.cancel()
            with suppress(asyncio.CancelledError):
                await self._task
            await self._write()

    async def _run(self) -> None:
        while True:
            await self._has_changes.wait()
            await asyncio.sleep(AGAIN_S if self._has_failed else TOGETHER_S)
            await self._write()

    async def _write(self) -> None:
        self._has_changes.clear()
        if not self._waiting or self._path is None:
            return
        rows = list(self._waiting)
        try:
            await asyncio.to_thread(write_changes, self._path, rows)
        except LogError as error:
            if not self._has_failed:
                log.error("changes are not recorded in %s: %s", self._path, error)
            self._has_failed = True
            self._has_changes.set()
        else:
            self._has_failed = False
            for row in rows:
                if self._waiting and self._waiting[0] is row:
                    self._waiting.popleft()


def write_changes(path: Path, rows: Sequence[Change]) -> None:
    """Adds rows. LogError if the disk refuses."""
    with as_log_error():
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        with closing(sqlite3.connect(path, timeout=5.0)) as db, db:
            db.execute("PRAGMA journal_mode = WAL")
            db.executescript(SCHEMA)
            places = ", ".join("?" * len(COLUMNS))
            names = ", ".join(COLUMNS)
            db.executemany(
                f"INSERT INTO changes ({names}) VALUES ({places})", [row[:-1] for row in rows]
            )
            db.execute(
                "DELETE FROM changes WHERE seq <= (SELECT max(seq) FROM changes) - ?", (MAX_ROWS,)
            )


class ChangeFilter(NamedTuple):
    """Changes of a robot ("" for the only one) from `since` on and before `until`, in seconds since the
    epoch. `only_stops`: states that are stops, and lost links. `seq`: only this change."""

    robot: str | None = None
    since: float = -math.inf
    until: float = math.inf
    only_stops: bool = False
    seq: int = 0


def read_changes(path: Path, wanted: ChangeFilter, most: int) -> list[Change]:
    """The newest changes of a filter, the oldest of them first; none without a file. LogError."""
    if not path.exists():
        return []
    conditions: Mapping[str, bool] = {
        "at >= :since AND at < :until": True,
        "robot = :robot": wanted.robot is not None,
        "breaks AND sort IN ('state', 'link')": wanted.only_stops,
        "seq = :seq": bool(wanted.seq),
    }
    where = " AND ".join(condition for condition, is_on in conditions.items() if is_on)
    query = f"SELECT {', '.join(COLUMNS)}, seq FROM changes WHERE {where} ORDER BY seq DESC LIMIT :most"
    with as_log_error(), closing(sqlite3.connect(f"{path.as_uri()}?mode=ro", uri=True)) as db:
        if not db.execute("SELECT 1 FROM sqlite_schema WHERE name = 'changes'").fetchone():
            return []
        rows = db.execute(query, {**wanted._asdict(), "most": most}).fetchall()
    return [_change(row) for row in reversed(rows)]


def _change(row: Sequence[Any]) -> Change:
    change = Change(*row)
    return change._replace(breaks=bool(change.breaks), heals=bool(change.heals))

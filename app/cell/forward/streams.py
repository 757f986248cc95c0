"""The streams of the forwarder: which rows each reads from which store of the cell, and what of them
the centre gets.

A store is read while another process writes it; each call is a short read on a connection of its own.
A row is known by its number. The mark of a row tells it from another row with the same number, of a
store that was replaced: of the log its hash, else its time.
"""

import json
import sqlite3
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final, NamedTuple

from app.cell.alarms.history import HistoryRow
from app.cell.alarms.records import finite, transition
from app.cell.alarms.report import NAME as STATES_FILE
from app.cell.alarms.report import NOT_RECORDED
from app.cell.alarms.store import NAME as ALARMS_FILE
from app.cell.forward.spool import HEALTH_COLUMNS, SPOOL_FILE, TREND_COLUMNS
from app.records.database import NAME as LOG_FILE
from app.records.database import as_log_error
from app.records.entry import FIELDS, Entry
from app.system.texts import TextLike, render, text_in

BUSY_TIMEOUT_S: Final = 1.0
MOST_BYTES: Final = 2_000_000  # of the texts of one batch
LATEST_MS: Final = 7_258_118_400_000  # the year 2200: PostgreSQL has no later than 294276
SAMPLED: Final = 200  # rows whose size stands for that of all


class Mark(NamedTuple):
    """What tells a row from another one with its number: its time (ms since 1970), and its hash, ""
    for a stream without."""

    at: int
    hash: str = ""

    def fits(self, other: "Mark") -> bool:
        """Whether it is the same row, whose time the other side may have rounded."""
        return self.hash == other.hash if self.hash and other.hash else abs(self.at - other.at) <= 1


class StreamRow(NamedTuple):
    """A row to be sent: `values` are in the order of the stream's columns."""

    seq: int
    mark: Mark
    values: tuple[Any, ...]
    size: int


class Backlog(NamedTuple):
    """What is not sent: how many rows, the time of the oldest (ms; None without one), and about how
    many bytes."""

    rows: int = 0
    oldest: int | None = None
    size: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Stream:
    """A stream: `name` in the settings, `store` and `source` its file and table in the data folder, of
    which it takes the rows that match `only`. `to` is the table of the centre, and `columns` what it
    gets, each with its type there: those of `read`, made by `convert`."""

    name: str
    store: str
    source: str
    to: str
    read: tuple[str, ...]
    columns: Mapping[str, str]
    convert: Callable[[tuple[Any, ...]], tuple[Any, ...]]
    at: str = "at"  # in ms, as SQL
    hash: str = "''"
    only: str = "1"
    own: bool = False  # of the forwarder: its rows are removed by it

    def rows(self, folder: Path, after: int, until: int, count: int) -> list[StreamRow]:
        """The next rows after the number `after`, up to `until`, at most `count`, and less where they
        are long. LogError."""
        columns = ", ".join(f'"{name}"' for name in self.read)
        query = (
            f"SELECT seq, {self.at}, {self.hash}, {columns} FROM {self.source}"
            f" WHERE seq > ? AND seq <= ? AND {self.only} ORDER BY seq LIMIT ?"
        )
        made: list[StreamRow] = []
        size = 0
        with _reading(folder / self.store, self.source) as db:
            for seq, at, digest, *values in db.execute(query, (after, until, count)) if db else ():
                sent = self.convert(tuple(values))
                length = sum(len(value) for value in sent if isinstance(value, str))
                if made and size + length > MOST_BYTES:
                    break
                size += length
                made.append(StreamRow(seq, Mark(_ms(at), digest), sent, length))
        return made

    def ends(self, folder: Path) -> tuple[int, int]:
        """The numbers of the first and the last row; (0, 0) without one. LogError."""
        with _reading(folder / self.store, self.source) as db:
            if db is None:
                return 0, 0
            query = f"SELECT min(seq), max(seq) FROM {self.source} WHERE {self.only}"
            first, last = db.execute(query).fetchone()
            return first or 0, last or 0

    def row_before(self, folder: Path, seq: int) -> tuple[int, Mark] | None:
        """The number and the mark of the last row up to a number; None without one. LogError."""
        with _reading(folder / self.store, self.source) as db:
            query = (
                f"SELECT seq, {self.at}, {self.hash} FROM {self.source} WHERE seq <= ? AND {self.only}"
                " ORDER BY seq DESC LIMIT 1"
            )
            row = db.execute(query, (seq,)).fetchone() if db else None
        return (row[0], Mark(_ms(row[1]), row[2])) if row else None

    def last_until(self, folder: Path, at: int) -> int:
        """The number of the last row up to a time (ms), 0 for none. LogError."""
        with _reading(folder / self.store, self.source) as db:
            query = f"SELECT max(seq) FROM {self.source} WHERE {self.at} <= ? AND {self.only}"
            row = db.execute(query, (at,)).fetchone() if db else None
        return (row[0] or 0) if row else 0

    def before(self, folder: Path, seq: int) -> str:
        """Of the log, the hash of the entry before this one; "" for other streams."""
        if not self.chained:
            return ""
        with _reading(folder / self.store, self.source) as db:
            row = db.execute("SELECT prev FROM entry WHERE seq = ?", (seq,)).fetchone() if db else None
        return str(row[0]) if row else ""

    @property
    def chained(self) -> bool:
        """Whether its rows are a chain without a gap."""
        return self.name == "log"

    @property
    def dense(self) -> bool:
        """Whether its numbers follow one another."""
        return self.only == "1"

    def backlog(self, folder: Path, after: int) -> Backlog:
        """What is after this row. LogError."""
        where = f"FROM {self.source} WHERE seq > ? AND {self.only}"
        lengths = " + ".join(f'ifnull(length("{name}"), 0)' for name in self.read)
        with _reading(folder / self.store, self.source) as db:
            if db is None:
                return Backlog()
            count, oldest = db.execute(f"SELECT count(*), min({self.at}) {where}", (after,)).fetchone()
            (mean,) = db.execute(
                f"SELECT avg({lengths}) FROM (SELECT * {where} ORDER BY seq LIMIT {SAMPLED})", (after,)
            ).fetchone()
        return Backlog(count, None if oldest is None else _ms(oldest), round((mean or 0) * count))


@contextmanager
def _reading(path: Path, table: str) -> Iterator[sqlite3.Connection | None]:
    """A read-only connection; None where the store, or its table, is not there yet. LogError."""
    if not path.exists():
        yield None
        return
    with as_log_error():
        uri = f"{path.absolute().as_uri()}?mode=ro"
        with closing(
            sqlite3.connect(uri, uri=True, timeout=BUSY_TIMEOUT_S, isolation_level=None)
        ) as db:
            db.text_factory = lambda data: data.decode("utf-8", "replace")
            there = db.execute("SELECT 1 FROM sqlite_schema WHERE name = ?", (table,)).fetchone()
            yield db if there else None


def _ms(at: float) -> int:
    """A time as ms that PostgreSQL takes: one that no clock was set to is cut."""
    return round(min(max(at, 0), LATEST_MS)) if at == at else 0


def time_of(at: int) -> datetime:
    """A time in ms since 1970 as PostgreSQL gets it."""
    return datetime.fromtimestamp(at // 1000, UTC).replace(microsecond=at % 1000 * 1000)


# What the centre gets of a row of each store.

_JSON: Final = json.JSONEncoder(ensure_ascii=False, separators=(",", ":")).encode


def _plain(value: Any) -> Any:
    """A text without NUL, which PostgreSQL has none of; other values as they are."""
    return value.replace("\0", "\\0") if isinstance(value, str) and "\0" in value else value


def _log(row: tuple[Any, ...]) -> tuple[Any, ...]:
    return row


def _alarm(row: tuple[Any, ...]) -> tuple[Any, ...]:
    history = HistoryRow(*row)
    try:
        about = finite(transition(history))
        text, value, limit = render(about["text"]), about["value"], about["limit"]
    except (ValueError, LookupError, TypeError, AttributeError):  # not a record: the row is sent
        text, value, limit = history.id, None, None
    values = (
        history.id, history.robot, history.group, history.priority, history.event, history.state,
        history.occurrence, history.act, history.actor, text, _number(value), _number(limit),
        _number(history.lasted_s), history.record,
    )  # fmt: skip
    return tuple(map(_plain, values))


def _state(row: tuple[Any, ...]) -> tuple[Any, ...]:
    robot, state = row
    try:
        about = json.loads(state) if state != NOT_RECORDED else {}
        text = render(_text(about.get("text", "")))
        values = (robot, text, about.get("shape", ""), about.get("colour", ""), state != NOT_RECORDED)
    except (ValueError, AttributeError):
        values = (robot, str(state), "", "", True)
    return tuple(map(_plain, values))


def _text(value: Any) -> TextLike:
    return text_in(_JSON(value)) if isinstance(value, dict) else str(value)


def _recipe(row: tuple[Any, ...]) -> tuple[Any, ...]:
    return tuple(map(_plain, row))


def _number(value: Any) -> float | None:
    return float(value) if isinstance(value, int | float) and abs(value) < 1e300 else None


TEXT: Final = "text"
# The columns of an entry, but for its number.
ENTRY_COLUMNS: Final = tuple(name for name in FIELDS if name != "seq")
ENTRY_TYPES: Final = {"at": "bigint", "monotonic": "bigint", "of": "bigint"}

STREAMS: Final[Mapping[str, Stream]] = {
    stream.name: stream
    for stream in (
        Stream(
            name="log",
            store=LOG_FILE,
            source="entry",
            to="log",
            read=ENTRY_COLUMNS,
            columns={
                "at_ms" if name == "at" else name: ENTRY_TYPES.get(name, TEXT) for name in ENTRY_COLUMNS
            },
            convert=_log,
            hash="hash",
        ),
        Stream(
            name="alarms",
            store=ALARMS_FILE,
            source="history",
            to="alarm",
            read=HistoryRow._fields,
            columns={
                "alarm": TEXT, "robot": TEXT, "group": TEXT, "priority": "integer", "event": TEXT,
                "state": TEXT, "occurrence": "bigint", "act": TEXT, "who": TEXT, "text": TEXT,
                "value": "float8", "limit": "float8", "lasted_s": "float8", "record": TEXT,
            },
            convert=_alarm,
            at="at * 1000.0",
        ),
        Stream(
            name="states",
            store=STATES_FILE,
            source="states",
            to="state",
            read=("robot", "state"),
            columns={name: TEXT for name in ("robot", "state", "shape", "colour")}
            | {"recorded": "boolean"},
            convert=_state,
            at="at * 1000.0",
        ),
        Stream(
            name="trends",
            store=SPOOL_FILE,
            source="trend",
            to="trend",
            read=TREND_COLUMNS,
            columns={
                "pen": "integer", "low": "float8", "high": "float8", "mean": "float8", "last": "float8",
                "count": "integer",
            },
            convert=tuple,
            own=True,
        ),
        Stream(
            name="recipes",
            store=LOG_FILE,
            source="entry",
            to="recipe",
            read=("who", "robot", "action", "widget", "outcome", "reason", "values"),
            columns={
                "who": TEXT, "robot": TEXT, "action": TEXT, "object": TEXT, "outcome": TEXT,
                "reason": TEXT, "values": TEXT,
            },
            convert=_recipe,
            only="kind = 'recipe'",
        ),
        Stream(
            name="health",
            store=SPOOL_FILE,
            source="health",
            to="health",
            read=tuple(HEALTH_COLUMNS),
            columns=HEALTH_COLUMNS,
            convert=tuple,
            own=True,
        ),
    )
}  # fmt: skip


def entry_of(values: Sequence[Any], seq: int) -> Entry:
    """The entry of a row of the centre's log: its columns in the order of `ENTRY_COLUMNS`."""
    return Entry(seq, *values)

"""The connection to the central database: who the panel is there, how far its rows are, and a batch of
rows in one transaction. Only this module, and the commands of the centre, use psycopg."""

import os
import re
import socket
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any, Final, NamedTuple, cast

from app.cell.forward.config import ConnectionConfig
from app.cell.forward.cursors import Position
from app.cell.forward.details import Detail, KnownPen, Request
from app.cell.forward.spool import Cursor, Pen
from app.cell.forward.streams import Mark, Stream, StreamRow, time_of
from app.system.errors import KioskError, os_error_text
from app.system.texts import TextLike, number, say

if TYPE_CHECKING:
    import psycopg

SCHEMA_VERSION: Final = 2  # of app/tools/central/sql
LEAST_VERSION: Final = 1  # that takes the rows; from DETAILS_VERSION on there are requests for details
DETAILS_VERSION: Final = 2
CONNECT_S: Final = 10
STATEMENT_S: Final = 120  # then the server is taken for one that does not answer
SILENT_S: Final = 30  # of a connection whose packets are not acknowledged
ANSWERED_WITHIN_S: Final = STATEMENT_S + SILENT_S
# The server ends a connection that is cut off as soon, and frees the panel's lock.
SERVER_OPTIONS: Final = (
    "-c tcp_keepalives_idle=10 -c tcp_keepalives_interval=5 -c tcp_keepalives_count=4"
    f" -c statement_timeout={STATEMENT_S}s -c lock_timeout={STATEMENT_S}s -c timezone=UTC"
)
PROGRAM: Final = "operator-panel"
MOST_OF_REASON: Final = 300  # characters


class CentreError(KioskError):
    """The centre can't be reached, or refuses; its text is for the operator. `lost`: the connection
    can't be used any more. `data`: a row is one that the database can't take."""

    def __init__(self, text: TextLike, *, lost: bool = True, data: bool = False) -> None:
        super().__init__(text)
        self.lost = lost
        self.data = data


class Batch(NamedTuple):
    """Rows of one stream to be sent at once, with what is new before them: where the generation begins
    (first row, hash before it), fields, and the rows that the cell no longer has, by first and last."""

    stream: Stream
    generation: int
    rows: Sequence[StreamRow]
    beginning: tuple[int, str] | None = None
    pens: Sequence[Pen] = ()
    gaps: Sequence[tuple[int, int, str]] = ()


# The code of the sentence for each state of SQL; the first match counts.
SENTENCES: Final[Mapping[str, str]] = {
    "28": "forward_sign_in",
    "3D000": "forward_no_database",
    "3F000": "forward_no_tables",
    "42P01": "forward_no_tables",
    "42883": "forward_no_tables",
    "42703": "forward_no_tables",
    "42501": "forward_not_permitted",
    "53100": "forward_centre_full",
    "57014": "forward_too_slow",
    "55P03": "forward_too_slow",
    "OP001": "forward_name_taken",
    "OP002": "forward_key_taken",
    "OP003": "forward_sent_twice",
    "OP004": "forward_other_role",
}
# What libpq says before the reason why there is no connection.
CONNECTION_WORDS: Final = re.compile(
    r"^(connection (failed|is bad): )?connection to server .*? failed: (FATAL: +)?"
)
# What the server says of a connection that it refuses: psycopg has no state of these.
REFUSED_CONNECTIONS: Final = {
    "no password supplied": "28000",
    "authentication failed": "28000",
    "no pg_hba.conf entry": "28000",
    "does not exist": "3D000",
}
DATA: Final = ("22",)  # classes of states: the row itself is refused


class Centre:
    """An open connection. Each method may raise CentreError."""

    def __init__(self, config: ConnectionConfig) -> None:
        self._address = config.address
        self._db = connect(config)
        self._panel = 0
        self.has_requests = False

    def close(self) -> None:
        with suppress(Exception):
            self._db.close()

    def register(self, panel: str, site: str, key: str) -> None:
        """Says which panel this is; no other program may be connected as it."""
        with self._errors(panel):
            row = self._db.execute("SELECT version, written_from FROM operator_panel.about").fetchone()
            version, written_from = row or (0, 0)
            if version < LEAST_VERSION or written_from > SCHEMA_VERSION:
                raise CentreError(
                    say(
                        "forward_other_version",
                        version=number(str(version)),
                        own=number(str(LEAST_VERSION)),
                    )
                )
            self.has_requests = version >= DETAILS_VERSION
            row = self._db.execute(
                "SELECT operator_panel.register(%s, %s, %s)", (panel, site, key)
            ).fetchone()
            assert row is not None  # a function returns a row
            self._panel = row[0]

    def clock(self) -> datetime:
        """The time of the server."""
        with self._errors():
            row = self._db.execute("SELECT clock_timestamp()").fetchone()
        assert row is not None
        return cast(datetime, row[0]).astimezone(UTC)

    def positions(self) -> dict[str, Position]:
        """The last row of each stream that has some."""
        with self._errors():
            rows = self._db.execute(
                "SELECT stream, generation, seq, at, hash FROM operator_panel.positions(%s)",
                (self._panel,),
            ).fetchall()
        return {
            stream: Position(generation, seq, Mark(_ms(at), digest))
            for stream, generation, seq, at, digest in rows
        }

    def mark(self, stream: str, generation: int, seq: int) -> Mark | None:
        """The mark of a row; None without the row."""
        with self._errors():
            row = self._db.execute(
                "SELECT at, hash FROM operator_panel.row_mark(%s, %s, %s, %s)",
                (self._panel, stream, generation, seq),
            ).fetchone()
        return Mark(_ms(row[0]), row[1]) if row else None

    def send(self, batch: Batch) -> Cursor:
        """Writes a batch in one transaction; returns how far the stream is sent then. Rows that the
        centre has already are left."""
        key = (self._panel, batch.stream.name, batch.generation)
        with self._errors(), self._db.transaction():
            if batch.beginning is not None:
                self._insert(
                    "beginning", "panel, stream, generation, first, prev", (*key, *batch.beginning)
                )
            for pen in batch.pens:
                row = (self._panel, batch.generation, *pen)
                self._insert("pen", "panel, generation, number, robot, topic, type, field", row)
            for first, last, reason in batch.gaps:
                gap = (*key, first, last, reason)
                self._insert("gap", "panel, stream, generation, first, last, reason", gap)
            if batch.rows:
                self._insert_rows(batch)
        last = batch.rows[-1].seq if batch.rows else max((gap[1] for gap in batch.gaps), default=0)
        return Cursor(batch.generation, last)

    def requests(self) -> list[Request]:
        """The open requests for details, the oldest first."""
        with self._errors():
            rows = self._db.execute(
                "SELECT id, pens, since, until, asked_by FROM operator_panel.open_requests(%s)",
                (self._panel,),
            ).fetchall()
        return [
            Request(number, tuple(pens), since.timestamp(), until.timestamp(), asked_by)
            for number, pens, since, until, asked_by in rows
        ]

    def known_pens(self) -> list[KnownPen]:
        """The pens whose minutes the centre has."""
        with self._errors():
            rows = self._db.execute(
                "SELECT generation, number, robot, topic, type, field"
                " FROM operator_panel.known_pens(%s)",
                (self._panel,),
            ).fetchall()
        return [KnownPen(generation, Pen(*pen)) for generation, *pen in rows]

    def send_details(self, known: KnownPen, details: Sequence[Detail]) -> None:
        """Writes values of a pen in one transaction. Those that the centre has already are left."""
        values: list[list[Any]] = [[time_of(round(detail.at * 1000)) for detail in details]]
        values += [list(column) for column in zip(*(detail[1:] for detail in details), strict=True)]
        with self._errors(), self._db.transaction():
            self._execute(
                "INSERT INTO operator_panel.trend_detail"
                " (panel, generation, pen, at, width, low, high, last) SELECT %s, %s, %s, * FROM"
                " unnest(%s::timestamptz[], %s::integer[], %s::float8[], %s::float8[], %s::float8[])"
                " ON CONFLICT DO NOTHING",
                (self._panel, known.generation, known.pen.number, *values),
            )

    def settle(self, request: Request, status: str, reason: str, rows: int) -> None:
        """Ends a request: `status` is "done" or "refused", `rows` how many values were sent."""
        with self._errors():
            self._execute(
                "SELECT operator_panel.settle_request(%s, %s, %s, %s, %s)",
                (self._panel, request.id, status, reason, rows),
            )

    def _insert(self, table: str, columns: str, row: tuple[Any, ...]) -> None:
        marks = ", ".join(["%s"] * len(row))
        self._execute(
            f"INSERT INTO operator_panel.{table} ({columns}) VALUES ({marks}) ON CONFLICT DO NOTHING",
            row,
        )

    def _insert_rows(self, batch: Batch) -> None:
        stream = batch.stream
        names = ", ".join(f'"{name}"' for name in stream.columns)
        arrays = ", ".join(
            f"%s::{kind}[]" for kind in ("bigint", "timestamptz", *stream.columns.values())
        )
        values: list[Any] = [
            [row.seq for row in batch.rows],
            [time_of(row.mark.at) for row in batch.rows],
        ]
        values += [list(column) for column in zip(*(row.values for row in batch.rows), strict=True)]
        self._execute(
            f"INSERT INTO operator_panel.{stream.to} (panel, generation, seq, at, {names})"
            f" SELECT %s, %s, * FROM unnest({arrays}) ON CONFLICT DO NOTHING",
            (self._panel, batch.generation, *values),
        )

    def _execute(self, query: str, values: Sequence[Any]) -> None:
        self._db.execute(query, values)  # of this module's own names

    @contextmanager
    def _errors(self, panel: str = "") -> Iterator[None]:
        """Errors of the database as CentreError."""
        import psycopg

        watch = threading.Timer(ANSWERED_WITHIN_S, self._hang_up)
        watch.daemon = True
        watch.start()
        try:
            yield
        except psycopg.Error as error:
            lost = self._db.closed or self._db.broken
            raise centre_error(error, self._address, panel, lost=lost) from error
        finally:
            watch.cancel()

    def _hang_up(self) -> None:
        """Ends the connection under a query that is not answered: what stands between may keep it open
        though nothing passes."""
        with suppress(Exception):
            end = socket.socket(fileno=os.dup(self._db.fileno()))
            end.shutdown(socket.SHUT_RDWR)
            end.close()


def connect(config: ConnectionConfig) -> "psycopg.Connection[tuple[Any, ...]]":
    """A connection; CentreError."""
    try:
        import psycopg
    except ImportError as error:
        raise CentreError(say("forward_not_installed")) from error
    keys: dict[str, Any] = dict(config.keys)
    if config.password_file is not None:
        keys["password"] = _password(config)
    try:
        return psycopg.connect(
            "",
            autocommit=True,
            connect_timeout=CONNECT_S,
            tcp_user_timeout=SILENT_S * 1000,
            keepalives_idle=SILENT_S // 3,
            keepalives_interval=5,
            keepalives_count=4,
            application_name=PROGRAM,
            options=SERVER_OPTIONS,
            passfile="/dev/null",
            prepare_threshold=2,
            **keys,
        )
    except psycopg.Error as error:
        raise centre_error(error, config.address) from error


def _password(config: ConnectionConfig) -> str:
    assert config.password_file is not None
    try:
        if config.password_file.stat().st_mode & 0o004:
            raise CentreError(say("forward_password_open", file=str(config.password_file)))
        return config.password_file.read_text(encoding="utf-8").strip("\r\n")
    except (OSError, ValueError) as error:
        why = os_error_text(error) if isinstance(error, OSError) else str(error)
        raise CentreError(
            say("forward_password_file", file=str(config.password_file), why=why)
        ) from error


def centre_error(
    error: "psycopg.Error", address: str, panel: str = "", *, lost: bool = True
) -> CentreError:
    """What psycopg reports, as a sentence."""
    state = error.sqlstate or ""
    detail = (error.diag.message_detail or "") if error.diag else ""
    primary = error.diag.message_primary if error.diag else None
    first_line = (primary or str(error)).strip().partition("\n")[0]
    why = " ".join(CONNECTION_WORDS.sub("", first_line).split())[:MOST_OF_REASON].rstrip(".")
    if not state:  # a connection that was refused
        state = next((known for words, known in REFUSED_CONNECTIONS.items() if words in why), "")
    code = next((SENTENCES[begin] for begin in (state, state[:2]) if begin in SENTENCES), "")
    if not code:
        code = (
            "forward_refused"
            if state and not state.startswith(("08", "57P", "53"))
            else "forward_unreachable"
        )
    about = {"address": address, "panel": panel, "detail": detail, "why": why}
    text = say(code, **{name: about[name] for name in PARAMETERS[code]})
    return CentreError(text, lost=lost, data=state[:2] in DATA)


# The parameters of each sentence.
PARAMETERS: Final[Mapping[str, tuple[str, ...]]] = {
    "forward_sign_in": ("address", "why"),
    "forward_no_database": ("address", "why"),
    "forward_no_tables": ("address", "why"),
    "forward_not_permitted": ("address", "why"),
    "forward_centre_full": ("address",),
    "forward_too_slow": ("address",),
    "forward_name_taken": ("panel",),
    "forward_key_taken": ("detail",),
    "forward_sent_twice": ("panel",),
    "forward_other_role": ("panel", "detail"),
    "forward_refused": ("address", "why"),
    "forward_unreachable": ("address", "why"),
}


def _ms(at: datetime) -> int:
    return round(at.timestamp() * 1000)

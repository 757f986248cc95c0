"""The schema of the central database: files of SQL with versions, partitions, and the removal of what
is old."""

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from app.cell.forward.centre import centre_error, connect
from app.cell.forward.config import ConnectionConfig
from app.system.errors import KioskError

if TYPE_CHECKING:
    from psycopg import Connection

    Database = Connection[tuple[Any, ...]]

FOLDER: Final = Path(__file__).parent / "sql"
FILE: Final = re.compile(r"([0-9]{3})\.sql")
LOCK: Final = 1330662216  # one command at a time
# The tables that are partitioned, by the stream.
TABLES: Final[Mapping[str, str]] = {
    "log": "log",
    "alarms": "alarm",
    "states": "state",
    "trends": "trend",
    "recipes": "recipe",
    "health": "health",
}


class CentralError(KioskError):
    """A command of the centre can't do its work."""


def versions() -> dict[int, Path]:
    """The files of SQL by their versions."""
    matches = ((FILE.fullmatch(path.name), path) for path in sorted(FOLDER.iterdir()))
    return {int(match[1]): path for match, path in matches if match}


@contextmanager
def database(config: ConnectionConfig) -> "Iterator[Database]":
    """A connection within the block; errors become sentences."""
    db = connect(config)
    import psycopg

    try:
        # A command waits as long as it takes.
        db.execute("SET statement_timeout = 0")
        db.execute("SET lock_timeout = 0")
        yield db
    except psycopg.Error as error:
        raise centre_error(error, config.address) from error
    finally:
        db.close()


def version_of(db: "Database") -> int:
    """The version of the schema; 0 without one."""
    row = db.execute("SELECT to_regclass('operator_panel.about') IS NOT NULL").fetchone()
    if not (row and row[0]):
        return 0
    row = db.execute("SELECT version FROM operator_panel.about").fetchone()
    return row[0] if row else 0


def upgrade(db: "Database", *, new: bool) -> tuple[int, int, int]:
    """Runs the files of SQL that are newer than the schema, all or none, and makes partitions. Returns
    the version before and after, and how many partitions were made. CentralError if the schema is there
    already (`new`), is not there, or is newer than this program."""
    files = versions()
    newest = max(files)
    with db.transaction():
        db.execute("SELECT pg_advisory_xact_lock(%s)", (LOCK,))
        before = version_of(db)
        if new and before:
            raise CentralError(
                f"the schema operator_panel is there already, in version {before}: use upgrade"
            )
        if not new and not before:
            raise CentralError("there is no schema operator_panel in this database: use init")
        if before > newest:
            raise CentralError(
                f"the database has version {before}, this program {newest}: use a newer operator-panel"
            )
        for version in range(before + 1, newest + 1):
            db.execute(files[version].read_bytes())
        row = db.execute("SELECT operator_panel.keep_partitions()").fetchone()
    return before, newest, row[0] if row else 0


def prune(db: "Database", days: int, streams: tuple[str, ...]) -> dict[str, int]:
    """Removes rows that are older than so many days; returns how many of each stream. Of the log, all
    entries of a panel before a signature whose entries before it are all as old: the rest begins with
    this signed head, so that it can be verified. With the trends go their details. Makes partitions."""
    removed: dict[str, int] = {}
    with db.transaction():
        db.execute("SELECT pg_advisory_xact_lock(%s)", (LOCK,))
        for stream in streams:
            removed[stream] = _prune_log(db, days) if stream == "log" else _prune(db, stream, days)
            _drop_empty(db, TABLES[stream], days)
        if "trends" in streams:
            removed["details"] = _prune_details(db, days)
            _drop_empty(db, "trend_detail", days)
        db.execute("SELECT operator_panel.keep_partitions()")
    return removed


OLD: Final = "now() - %(days)s * interval '1 day'"


def _prune_log(db: "Database", days: int) -> int:
    """The cut is the newest signature before the first entry that is recent enough."""
    cuts = db.execute(
        f"""
        WITH kept AS (
          SELECT panel, generation, coalesce(min(seq) FILTER (WHERE at >= {OLD}), max(seq)) AS first
          FROM operator_panel.log GROUP BY panel, generation
        )
        SELECT k.panel, k.generation, max(l.seq) FROM kept k JOIN operator_panel.log l
          ON l.panel = k.panel AND l.generation = k.generation AND l.seq <= k.first
        WHERE l.kind = 'signed' GROUP BY k.panel, k.generation
        """,
        {"days": days},
    ).fetchall()
    count = 0
    for panel, generation, cut in cuts:
        where = {"panel": panel, "generation": generation, "cut": cut}
        of_panel = "panel = %(panel)s AND generation = %(generation)s"
        db.execute(
            "INSERT INTO operator_panel.pruned (panel, stream, generation, upto, hash)"
            f" SELECT panel, 'log', generation, seq, hash FROM operator_panel.log WHERE {of_panel}"
            " AND seq = (SELECT max(seq) FROM operator_panel.log"
            f" WHERE {of_panel} AND seq < %(cut)s) ON CONFLICT DO NOTHING",
            where,
        )
        deleted = db.execute(
            f"DELETE FROM operator_panel.log WHERE {of_panel} AND seq < %(cut)s", where
        )
        count += deleted.rowcount
    return count


def _prune(db: "Database", stream: str, days: int) -> int:
    """Notes the last row of each panel that goes."""
    table = f"operator_panel.{TABLES[stream]}"
    db.execute(
        "INSERT INTO operator_panel.pruned (panel, stream, generation, upto, hash)"
        f" SELECT panel, %(stream)s, generation, max(seq), '' FROM {table} WHERE at < {OLD}"
        " GROUP BY panel, generation ON CONFLICT DO NOTHING",
        {"stream": stream, "days": days},
    )
    return db.execute(f"DELETE FROM {table} WHERE at < {OLD}", {"days": days}).rowcount


def _prune_details(db: "Database", days: int) -> int:
    """Of the requests goes what was settled as long ago."""
    old = {"days": days}
    db.execute(f"DELETE FROM operator_panel.detail_request WHERE settled_at < {OLD}", old)
    return db.execute(f"DELETE FROM operator_panel.trend_detail WHERE at < {OLD}", old).rowcount


def _drop_empty(db: "Database", table: str, days: int) -> None:
    """Drops the partitions of old months, which are empty then, and gives their space back."""
    rows = db.execute(
        "SELECT c.relname, to_date(right(c.relname, 7), 'YYYY_MM') + interval '1 month'"
        f" < {OLD} FROM pg_inherits i JOIN pg_class c ON c.oid = i.inhrelid"
        " WHERE i.inhparent = %(parent)s::regclass AND c.relname ~ '_[0-9]{4}_[0-9]{2}$'",
        {"days": days, "parent": f"operator_panel.{table}"},
    ).fetchall()
    for name, is_old in rows:
        if not is_old:
            continue
        row = db.execute(f'SELECT EXISTS (SELECT 1 FROM operator_panel."{name}")').fetchone()
        if row and not row[0]:
            db.execute(f'DROP TABLE operator_panel."{name}"')

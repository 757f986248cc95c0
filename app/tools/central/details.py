"""Requests for the details of trends, which a cell sends when it is asked for them."""

from collections.abc import Sequence
from datetime import datetime
from typing import TYPE_CHECKING, Final, NamedTuple

from app.cell.forward.centre import DETAILS_VERSION
from app.tools.central.schema import CentralError, version_of

if TYPE_CHECKING:
    from app.tools.central.schema import Database

REFUSED: Final = "OP005"  # what ask_details says of a request that no cell answers
MOST_LISTED: Final = 100


class DetailRequest(NamedTuple):
    """A request with its end: `status` is open, done or refused; `rows` values were sent."""

    number: int
    panel: str
    pens: Sequence[str]
    since: datetime
    until: datetime
    asked_by: str
    asked_at: datetime
    status: str
    reason: str
    rows: int


def ask(
    db: "Database", panel: str, pens: Sequence[str], since: datetime, until: datetime | None = None
) -> int:
    """Asks a panel for the details of a time span, until now without an end, of all pens without names;
    returns the number of the request. CentralError if it is one that no cell answers."""
    import psycopg

    _check_version(db)
    try:
        row = db.execute(
            "SELECT operator_panel.ask_details(%s, %s, %s, coalesce(%s, now()))",
            (panel, list(pens), since, until),
        ).fetchone()
    except psycopg.Error as error:
        if error.sqlstate != REFUSED:
            raise
        raise CentralError(error.diag.message_primary or str(error)) from error
    assert row is not None  # a function returns a row
    return int(row[0])


def requests(db: "Database", panel: str = "") -> list[DetailRequest]:
    """The newest requests, the newest first; only those of this panel, if one is given."""
    _check_version(db)
    rows = db.execute(
        "SELECT r.id, p.name, r.pens, r.since, r.until, r.asked_by, r.asked_at, r.status, r.reason,"
        " r.rows FROM operator_panel.detail_request r JOIN operator_panel.panel p ON p.id = r.panel"
        " WHERE %s IN ('', p.name) ORDER BY r.id DESC LIMIT %s",
        (panel, MOST_LISTED),
    ).fetchall()
    return [DetailRequest(*row) for row in rows]


def _check_version(db: "Database") -> None:
    version = version_of(db)
    if version < DETAILS_VERSION:
        raise CentralError(
            f"the database has version {version}, requests need {DETAILS_VERSION}:"
            " run operator-panel central upgrade"
        )

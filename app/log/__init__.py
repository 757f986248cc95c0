"""The operator's log: who pressed what, and what came of it."""

from app.log.entry import Entry, Origin, entered
from app.log.reading import Filter, Row, Unended
from app.log.ticket import Limits
from app.log.unlogged import Unlogged
from app.log.writer import OperatorLog

__all__ = [
    "Entry",
    "Filter",
    "Limits",
    "OperatorLog",
    "Origin",
    "Row",
    "Unended",
    "Unlogged",
    "entered",
]

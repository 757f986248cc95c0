"""The operator's log: who pressed what, and what came of it."""

from app.log.entry import Entry, Origin, entered, same_values
from app.log.process import ReaderProcess
from app.log.reading import Filter, Row, Unended
from app.log.ticket import Limits, Repeated
from app.log.unlogged import Unlogged
from app.log.writer import OperatorLog

__all__ = [
    "Entry",
    "Filter",
    "Limits",
    "OperatorLog",
    "Origin",
    "ReaderProcess",
    "Repeated",
    "Row",
    "Unended",
    "Unlogged",
    "entered",
    "same_values",
]

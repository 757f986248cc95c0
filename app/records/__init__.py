"""The operator's log, an audit log: each press with its client, and the result."""

from app.records.database import Filter, LogRow, OpenPress
from app.records.entry import Entry, Origin, new_entry, same_values
from app.records.log import NullLog, OperatorLog
from app.records.store import Limits, Repeated

__all__ = [
    "Entry",
    "Filter",
    "Limits",
    "LogRow",
    "NullLog",
    "OpenPress",
    "OperatorLog",
    "Origin",
    "Repeated",
    "new_entry",
    "same_values",
]

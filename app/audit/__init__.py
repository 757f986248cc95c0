"""The operator's log, an audit log: each press with its client, and the result."""

from app.audit.audit_log import OperatorLog
from app.audit.entry import Entry, Origin, new_entry, same_values
from app.audit.null_log import NullLog
from app.audit.queries import Filter, OpenPress, Row
from app.audit.reader_process import ReaderProcess
from app.audit.ticket import Limits, Repeated

__all__ = [
    "Entry",
    "Filter",
    "Limits",
    "NullLog",
    "OpenPress",
    "OperatorLog",
    "Origin",
    "ReaderProcess",
    "Repeated",
    "Row",
    "new_entry",
    "same_values",
]

"""Entries waiting to be written to the operator's log, and the log's limits."""

import asyncio
from dataclasses import dataclass

from app.audit.entry import Entry
from app.errors import LogError


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """How long entries are kept, how large the file may be, and whether presses need it."""

    days: float = 365.0
    size_mb: float = 512.0
    required: bool = True


class Repeated(Exception):
    """The log already has a press with this id: `press` is its entry, `last_entry` the newest entry
    about it, None without one."""

    def __init__(self, press: Entry, last_entry: Entry | None) -> None:
        super().__init__(f"press {press.press} is entry {press.seq}")
        self.press = press
        self.last_entry = last_entry


@dataclass(slots=True, eq=False)
class Ticket:
    """An entry to be written; `result` is the entry as written, or the reason why it was not.

    A press has its result when it is committed, any other entry when it is on the disk. `waiter` is
    done then, or at a timeout. `answered`: the writer has reported its result.
    """

    entry: Entry
    waiter: "asyncio.Future[None]"
    result: Entry | LogError | Repeated | None = None
    abandoned: bool = False
    answered: bool = False

    def wake(self) -> None:
        """Ends the waiting for this entry."""
        if not self.waiter.done():
            self.waiter.set_result(None)

    @property
    def durable(self) -> bool:
        return self.entry.kind != "pressed"


Results = list[tuple[Ticket, Entry | LogError | Repeated]]

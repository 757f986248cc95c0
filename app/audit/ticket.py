"""What is handed to the operator's log, and the rules that it follows."""

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
    """A press whose id the log has already: its entry `press`, and `told`, what was said of it last;
    None where nothing was."""

    def __init__(self, press: Entry, told: Entry | None) -> None:
        super().__init__(f"press {press.press} is entry {press.seq}")
        self.press = press
        self.told = told


@dataclass(slots=True, eq=False)
class Ticket:
    """An entry to be written; `result` is the one that stands in the file, or why there is none.

    That of a press is there when it is committed, any other when it is on the disk. `waiter` is for who
    waits for that, and may be called away.
    """

    entry: Entry
    waiter: "asyncio.Future[None]"
    result: Entry | LogError | Repeated | None = None
    abandoned: bool = False

    def wake(self) -> None:
        """Nothing waits for it any longer."""
        if not self.waiter.done():
            self.waiter.set_result(None)

    @property
    def durable(self) -> bool:
        return self.entry.kind != "pressed"


Results = list[tuple[Ticket, Entry | LogError | Repeated]]

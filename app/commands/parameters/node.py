"""A node with parameters that the panel shows, and when it is to be asked again."""

import asyncio
import math
from dataclasses import dataclass, field
from typing import Any

from app.panel.widgets.parameter import Parameter


@dataclass(slots=True)
class Node:
    """`heard` are values of events that came while it is being asked.

    `wanted` is set when it is to be asked again, `urgent` when that is not to wait for the pause
    between two readings; `told_at` (monotonic seconds) is when it answered last.
    """

    name: str
    widgets: list[Parameter] = field(default_factory=list)
    query_needed: asyncio.Event = field(default_factory=asyncio.Event)
    query_now: asyncio.Event = field(default_factory=asyncio.Event)
    event_values: dict[str, Any] = field(default_factory=dict)
    answered_at: float = -math.inf
    task: "asyncio.Task[None] | None" = None

    def request_query(self) -> None:
        self.query_needed.set()
        self.query_now.set()

    def begin_query(self) -> None:
        """It is asked now: what was wanted until here is done by that."""
        self.query_needed.clear()
        self.query_now.clear()
        self.event_values.clear()


async def within(event: asyncio.Event, longest_s: float | None) -> None:
    """Waits for an event, or until this time is up."""
    try:
        async with asyncio.timeout(longest_s):
            await event.wait()
    except TimeoutError:
        pass

"""A node with parameters that the panel shows, and when to query it again."""

import asyncio
import math
from dataclasses import dataclass, field
from typing import Any

from app.panel.widgets.parameter import Parameter


@dataclass(slots=True, eq=False)
class Node:
    """A node; `task` queries it while its services are available.

    `event_values` are values from events during a query. `query_needed` is set when the node has to be
    queried again, `query_now` when that must not wait for the pause between two queries. `answered_at`
    (monotonic seconds) is the time of its last response, `asked_at` that of the request for it.
    """

    name: str
    widgets: list[Parameter] = field(default_factory=list)
    query_needed: asyncio.Event = field(default_factory=asyncio.Event)
    query_now: asyncio.Event = field(default_factory=asyncio.Event)
    event_values: dict[str, Any] = field(default_factory=dict)
    answered_at: float = -math.inf
    asked_at: float = -math.inf
    task: "asyncio.Task[None] | None" = None

    def request_query(self) -> None:
        self.query_needed.set()
        self.query_now.set()

    def begin_query(self) -> None:
        """Resets the requests for a query, which this query fulfils."""
        self.query_needed.clear()
        self.query_now.clear()
        self.event_values.clear()


async def within(event: asyncio.Event, longest_s: float | None) -> None:
    """Waits for an event, at most `longest_s` seconds (None: no limit)."""
    try:
        async with asyncio.timeout(longest_s):
            await event.wait()
    except TimeoutError:
        pass

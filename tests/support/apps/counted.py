"""The server's application with another path, `/sizes`, for a test of memory growth.

It waits for late responses only for `LATE_S`, so that a test sees the end of the wait, and has no rate
limits.
"""

import asyncio
import gc
from collections.abc import Iterator, Sized
from dataclasses import replace
from typing import Any, cast

from fastapi import Request

from app.cell.commands import services
from app.cell.permission.client_limits import RATE_LIMITS
from app.main import app
from app.system.limits import Quota
from app.system.texts import text
from app.web.app_state import site_of

LATE_S = 0.5
UNLIMITED = Quota(1e9, 1e9)
vars(services)["LATE_S"] = LATE_S  # Final in the application
for name in ("presses", "address_presses"):
    cast(dict[str, Any], RATE_LIMITS)[name] = replace(RATE_LIMITS[name], quota=UNLIMITED)


@app.get("/sizes")
async def sizes(request: Request) -> dict[str, int]:
    """The number of objects and tasks, and the length of all collections of the session and its
    parts."""
    kiosk = site_of(request).fleet.first
    text._rendered.cache_clear()  # it grows to its limit
    gc.collect()
    held = {"objects": len(gc.get_objects()), "tasks": len(asyncio.all_tasks())}
    chosen = getattr(kiosk.peer, "_chosen", None) or kiosk.peer  # the file does not say which
    wholes = (kiosk, kiosk.context, kiosk.commands, kiosk.peer, chosen)
    held_by = [part for whole in wholes for part in vars(whole).values()]
    parts = [holder for holder in held_by if type(holder).__module__.startswith("app.")]
    for part in (kiosk, *parts, kiosk.link._inbox, kiosk.robot.graph, kiosk.presses):
        held |= {f"{type(part).__name__}.{name}": len(value) for name, value in sized(part)}
    return held


def sized(part: Any) -> Iterator[tuple[str, Sized]]:
    for name, value in vars(part).items():
        if isinstance(value, Sized) and not isinstance(value, str):
            yield name, value

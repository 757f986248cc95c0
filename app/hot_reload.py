"""`make dev`: what is saved takes effect: the panel file, interface files beside it, templates and
static files.

Python files are uvicorn's to watch (`--reload`). A panel file with a fault keeps the old panel on
the screen, with the fault above it. A page that can't be made, for a fault in its template, says so
and comes by itself when that is mended.
"""

import asyncio
import logging
import traceback
from collections.abc import AsyncIterator, Callable
from contextlib import AbstractAsyncContextManager, AsyncExitStack, asynccontextmanager, suppress
from pathlib import Path

from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response

from app.errors import KioskError, PanelError
from app.panel import Panel, load_panel
from app.runtime.fleet import Fleet
from app.settings import Settings, shipped
from app.web.app_state import Site
from app.web.assets import Assets

log = logging.getLogger("kiosk.development")

EMPTY_PANEL = Panel.model_validate(
    {"title": "No panel", "mode": "demo", "page": [{"id": "none", "title": "No page"}]}
)

SUFFIXES = (".html", ".css", ".js", ".msg", ".srv", ".action")

TRY_AGAIN = {"refresh": "1"}  # seconds

Running = Callable[[Settings, Panel], AbstractAsyncContextManager[tuple[Fleet, Assets]]]


@asynccontextmanager
async def reloading(
    site: Site, settings: Settings, running: Running, opened: AsyncExitStack
) -> AsyncIterator[None]:
    """Watches while it is entered; `opened` holds what runs now and is closed when replaced."""
    reloader = _Reloader(site, settings, running, opened)
    task = asyncio.create_task(reloader.watch())
    try:
        yield
    finally:
        task.cancel()
        with suppress(asyncio.CancelledError):
            await task
        await reloader.opened.aclose()


async def on_error(request: Request, error: Exception) -> Response:
    """What went wrong, for who develops; a page is asked for again until it comes."""
    told = "".join(traceback.format_exception(error))
    return PlainTextResponse(told, 500, headers=TRY_AGAIN if request.method == "GET" else None)


class _Reloader:
    def __init__(
        self, site: Site, settings: Settings, running: Running, opened: AsyncExitStack
    ) -> None:
        self._site = site
        self._settings = settings
        self._running = running
        self.opened = opened

    async def watch(self) -> None:
        from watchfiles import awatch  # needed, and installed, in development only

        panel = self._settings.panel
        watched = (panel.parent, shipped("templates"), shipped("static"))
        async for changes in awatch(*watched, recursive=True):
            touched = {Path(path) for _, path in changes}
            files = {path for path in touched if path.suffix in SUFFIXES}
            if panel in touched or files:
                await self._reload()

    async def _reload(self) -> None:
        try:
            panel = load_panel(self._settings.panel)
            opened = AsyncExitStack()
            fleet, assets = await opened.enter_async_context(self._running(self._settings, panel))
        except PanelError as error:
            log.error("%s", error)
            self._site.fleet.show_fault(str(error))
        except (KioskError, OSError) as error:
            log.error("the change was not taken: %s", error)
            self._site.fleet.show_fault(str(error))
        else:
            old, self.opened = self.opened, opened
            self._site.fleet, self._site.assets = fleet, assets
            self._site.metrics.follow(fleet)
            await old.aclose()
            log.info("took the change")

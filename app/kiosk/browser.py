"""Chromium as the kiosk has it: its flags, its one page, and what is seen of it."""

import asyncio
import os
import shutil
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

from app.errors import SettingsError
from app.kiosk.child import Child, high_pipe
from app.kiosk.config import BROWSERS
from app.kiosk.devtools import BROWSER_READS, BROWSER_WRITES, DevTools, DevToolsError, Event, NoResponse
from app.kiosk.judge import PageStatus
from app.kiosk.page_script import KEEP_IN, LOOK

# How long a browser may take to start on a busy machine.
STARTS_WITHIN_S: Final = 30.0
# A page that does not respond for so long hangs. A busy machine delays a page by less.
HANGS_AFTER_S: Final = 4.0
POLL_S: Final = 0.05

FLAGS: Final = (
    "--kiosk",
    "--no-first-run",
    "--no-default-browser-check",
    "--noerrdialogs",
    "--hide-crash-restore-bubble",
    "--disable-session-crashed-bubble",
    "--disable-infobars",
    "--disable-pinch",
    "--overscroll-history-navigation=0",
    "--disable-extensions",
    "--disable-component-extensions-with-background-pages",
    "--disable-component-update",
    "--disable-background-networking",
    "--disable-sync",
    "--disable-breakpad",
    "--disable-domain-reliability",
    "--disable-quic",
    "--disable-print-preview",
    "--disable-speech-api",
    "--disable-backgrounding-occluded-windows",
    "--disable-renderer-backgrounding",
    "--disable-features=Translate,MediaRouter,OptimizationHints,InterestFeedContentSuggestions,"
    "CalculateNativeWinOcclusion,TouchpadOverscrollHistoryNavigation,SpareRendererForSitePerProcess",
    # It runs without a sandbox of its own on Linux anyway: 25 MB less than as a process.
    "--enable-features=NetworkServiceInProcess2",
    "--password-store=basic",
    "--autoplay-policy=no-user-gesture-required",
    "--disk-cache-size=8388608",
    "--media-cache-size=1",
    "--log-level=3",  # it complains of each service that a kiosk does not have
    "--remote-debugging-pipe",
)


def find_browser(chosen: str) -> str:
    """The path of the browser's program; SettingsError if there is none."""
    for name in (chosen,) if chosen else BROWSERS:
        if path := shutil.which(name):
            return path
    raise SettingsError(
        f"there is no browser {chosen}: install it, or name another one as browser"
        if chosen
        else f"there is no browser: install one of {', '.join(BROWSERS)}"
    )


class Browser:
    """One run of the browser, from `start` to `end`."""

    def __init__(self, program: str, flags: Sequence[str], profile: Path) -> None:
        self._command = [program, *FLAGS, *flags, f"--user-data-dir={profile}"]
        self._devtools = DevTools(self._event)
        self._child: Child | None = None
        self._target = self._session = ""
        self._crashed = False
        self._others: set[str] = set()

    @property
    def runs(self) -> bool:
        return self._child is not None and self._child.runs

    @property
    def pid(self) -> int:
        return self._child.pid if self._child else 0

    async def start(self, url: str, env: Mapping[str, str]) -> None:
        """Opens `url` in the only window. DevToolsError if the browser does not get that far."""
        its_read, write_fd = high_pipe()
        read_fd, its_write = high_pipe()
        inherited = {its_read: BROWSER_READS, its_write: BROWSER_WRITES}
        try:
            self._child = Child([*self._command, f"--app={url}"], env, inherited)
        finally:
            for fd in inherited:
                os.close(fd)
            await self._devtools.open(read_fd, write_fd)
        try:
            async with asyncio.timeout(STARTS_WITHIN_S):
                await self._call("Target.setDiscoverTargets", discover=True)
                while not self._target:
                    await asyncio.sleep(POLL_S)
                await self._attach()
        except TimeoutError:
            raise NoResponse(f"the browser did not start within {STARTS_WITHIN_S:g} s") from None

    async def look(self, waiting_url: str, origin: str) -> PageStatus:
        """What the page shows now."""
        await self._close_others()
        if self._crashed:
            return PageStatus(crashed=True)
        try:
            seen = await self._evaluate(LOOK)
        except NoResponse:
            return PageStatus(crashed=True) if self._crashed else PageStatus(responds=False)
        except DevToolsError:  # between two documents; a browser that is gone is seen by its end
            return PageStatus(crashed=self._crashed, on_panel=True, ours=True, age_s=0.0)
        url = str(seen["url"])
        return PageStatus(
            waiting=url == waiting_url,
            on_panel=url.startswith(f"{origin}/"),
            ours=bool(seen["ours"]),
            age_s=seen["age_s"],
            drawn=bool(seen["drawn"]),
        )

    async def open(self, url: str) -> None:
        """Opens another page in the window. It is shown, or not, by the time of a later look."""
        self._crashed = False
        with suppress(NoResponse):
            await self._call("Page.navigate", session=self._session, url=url)

    async def ignore_input(self, ignore: bool) -> None:
        """Whether touches and keys reach no page."""
        with suppress(DevToolsError):
            await self._call("Input.setIgnoreInputEvents", session=self._session, ignore=ignore)

    async def end(self) -> None:
        self._devtools.close()
        if self._child is not None:
            await self._child.end()

    async def _attach(self) -> None:
        session = await self._call("Target.attachToTarget", targetId=self._target, flatten=True)
        self._session = str(session["sessionId"])
        add = "Page.addScriptToEvaluateOnNewDocument"
        await self._call("Page.enable", session=self._session)
        await self._call(add, session=self._session, source=KEEP_IN, runImmediately=True)

    async def _close_others(self) -> None:
        """A further window or tab covers the panel: nothing of the panel opens one."""
        for target in list(self._others):
            with suppress(DevToolsError):
                await self._call("Target.closeTarget", targetId=target)

    async def _evaluate(self, expression: str) -> dict[str, Any]:
        parameters = {"expression": expression, "awaitPromise": True, "returnByValue": True}
        result = await self._call("Runtime.evaluate", session=self._session, **parameters)
        if "exceptionDetails" in result:
            raise DevToolsError("the page could not be looked at")
        return dict(result["result"]["value"])

    async def _call(self, method: str, session: str = "", **params: Any) -> dict[str, Any]:
        return await self._devtools.call(method, HANGS_AFTER_S, session, **params)

    def _event(self, method: str, params: Event) -> None:
        if method == "Target.targetCreated" and params["targetInfo"]["type"] == "page":
            target = params["targetInfo"]["targetId"]
            if self._target:
                self._others.add(target)
            else:
                self._target = target
        elif method == "Target.targetCrashed" and params["targetId"] == self._target:
            self._crashed = True
        elif method == "Target.targetDestroyed":
            self._others.discard(params["targetId"])
            if params["targetId"] == self._target:  # closed by a key of the browser
                self._devtools.close()

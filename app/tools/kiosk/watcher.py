"""Keeps the panel on the screen: compositor, browser and page, each restarted when it hangs.

Everything is judged in one loop, about once a second. The service manager gets its ping from this loop,
so a watcher that hangs is restarted too, with all that it started.
"""

import asyncio
import logging
import shutil
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Final
from urllib.parse import urlsplit

from app.system.errors import SettingsError
from app.system.process.service import ServiceManager, status_line
from app.tools.kiosk.browser import Browser, DevToolsError, find_browser
from app.tools.kiosk.config import KioskConfig, panel_language
from app.tools.kiosk.judge import Action, Judge
from app.tools.kiosk.screen import Compositor, Night
from app.tools.kiosk.waiting_page import write_page

if TYPE_CHECKING:
    import ssl


# Whether the panel server answers: one small request on loopback.

ANSWERS_WITHIN_S: Final = 1.0


async def server_answers(url: str, path: str = "/healthz") -> bool:
    """Whether the server of `url` responds with status 200 in time."""
    try:
        async with asyncio.timeout(ANSWERS_WITHIN_S):
            return await _status(url, path) == 200
    except (OSError, TimeoutError, ValueError):
        return False


async def _status(url: str, path: str) -> int:
    parts = urlsplit(url)
    secure = parts.scheme == "https"
    port = parts.port or (443 if secure else 80)
    # The certificate is the browser's to check: whether the server runs is all that counts here.
    context = _unchecked() if secure else None
    reader, writer = await asyncio.open_connection(parts.hostname, port, ssl=context)
    try:
        request = f"GET {path} HTTP/1.1\r\nHost: {parts.netloc}\r\nConnection: close\r\n\r\n"
        writer.write(request.encode())
        return int((await reader.readline()).split()[1])
    except IndexError:
        return 0
    finally:
        writer.close()
        with suppress(OSError):
            await writer.wait_closed()


def _unchecked() -> "ssl.SSLContext":
    import ssl  # 3 MiB that a panel on HTTP does not need

    context = ssl.create_default_context()
    context.check_hostname = False
    context.verify_mode = ssl.CERT_NONE
    return context


log = logging.getLogger("kiosk.screen")

LOOK_INTERVAL_S: Final = 1.0
WAITING_INTERVAL_S: Final = 0.1  # while the panel is not shown
# From this age of the last event on the server is queried.
YOUNG_S: Final = 2.0
# After a start that failed, so that a missing part does not fill the machine's log.
PAUSE_S: Final = 1.0


class Watcher:
    """Runs from `run` until it is cancelled. `folder` is in memory: it has the profile and more."""

    def __init__(
        self, config: KioskConfig, folder: Path, manager: ServiceManager, env: Mapping[str, str]
    ) -> None:
        self._config = config
        self._folder = folder
        self._manager = manager
        places = {
            "HOME": folder,
            "XDG_CONFIG_HOME": folder / "config",
            "XDG_CACHE_HOME": folder / "cache",
        }
        self._env = {**env, **{name: str(path) for name, path in places.items()}}
        self._program = find_browser(config.browser)
        self._compositor = Compositor(config, folder, self._env)
        self._night = Night(config, self._compositor.power, self._ignore_input)
        self._browser: Browser | None = None
        self._judge = Judge()
        self._starts_failed = 0
        self._interval_s = LOOK_INTERVAL_S
        self._stopping = False
        self._waiting = folder / "waiting.html"

    async def run(self) -> None:
        try:
            while not self._stopping:
                try:
                    await self._step()
                except (DevToolsError, SettingsError, OSError) as error:
                    log.error("the browser is restarted: %s", error)
                    await self._stop_browser()
                    self._starts_failed += 1
                    await asyncio.sleep(PAUSE_S)
                else:
                    await asyncio.sleep(self._interval_s)
                self._notify()
        finally:
            self._stopping = True
            self._manager.notify("STOPPING=1")
            await self._night.end()
            await self._stop_browser()
            await self._compositor.end()

    def stop(self) -> None:
        """`run` ends after what it is doing now, even if its task loses a cancellation."""
        self._stopping = True

    async def _step(self) -> None:
        if not self._compositor.runs:
            await self._stop_browser()
            await self._compositor.start()
        browser = self._browser
        if browser is None or not browser.runs:
            await self._start_browser()
        else:
            await self._judge_page(browser)
        await self._night.update(datetime.now().time(), self._compositor.env)

    async def _start_browser(self) -> None:
        if self._browser is not None:
            log.error("the browser ended: it is started again")
            await self._stop_browser()
        profile = self._folder / "profile"
        if self._starts_failed:  # perhaps by what is in it
            shutil.rmtree(profile, ignore_errors=True)
        up = await server_answers(self._config.url)
        url = self._config.url if up else self._waiting_url()
        flags = (*self._compositor.flags, *self._language_flags(), *self._config.flags)
        self._browser = Browser(self._program, flags, profile)
        await self._browser.start(url, self._compositor.env)
        if self._night.dark:
            await self._browser.ignore_input(True)
        self._starts_failed = 0
        self._interval_s = LOOK_INTERVAL_S if up else WAITING_INTERVAL_S
        self._judge = Judge()
        log.info("the browser shows %s", "the panel" if up else "that the server does not answer yet")

    async def _judge_page(self, browser: Browser) -> None:
        look = await browser.look(self._waiting.as_uri(), self._config.origin)
        young = look.on_panel and look.age_s is not None and look.age_s < YOUNG_S
        server = None if young and look.responds else await server_answers(self._config.url)
        if self._night.dark:
            look = replace(look, drawn=True)
        verdict = self._judge.judge(look, server, monotonic())
        self._interval_s = WAITING_INTERVAL_S if look.waiting else LOOK_INTERVAL_S
        if verdict.action is not Action.NONE:
            log.info("%s: %s", verdict.reason, verdict.action.value)
        if verdict.action is Action.OPEN_PANEL:
            await browser.open(self._config.url)
        elif verdict.action is Action.OPEN_WAITING:
            await browser.open(self._waiting_url())
        elif verdict.action is Action.RESTART:
            await self._stop_browser()
            await self._start_browser()

    async def _stop_browser(self) -> None:
        browser, self._browser = self._browser, None
        if browser is not None:
            await browser.end()

    async def _ignore_input(self, ignore: bool) -> None:
        if self._browser is not None:
            await self._browser.ignore_input(ignore)

    def _waiting_url(self) -> str:
        """The address of the waiting page, which is made when it is needed for the first time."""
        if not self._waiting.exists():
            write_page(Path(self._config.panel), self._waiting)
        return self._waiting.as_uri()

    def _language_flags(self) -> tuple[str, ...]:
        language = panel_language(Path(self._config.panel))
        return (f"--accept-lang={language}",) if language else ()

    def _notify(self) -> None:
        shown = "the browser runs" if self._browser is not None else "the browser does not start"
        ready = ["READY=1"] if self._browser is not None else []
        self._manager.notify(*ready, "WATCHDOG=1", status_line(shown))

"""Chromium on the kiosk: its process, its flags, the Chrome DevTools Protocol, and what runs in its
page."""

import asyncio
import fcntl
import json
import os
import shutil
import signal
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

from app.system.errors import SettingsError
from app.tools.kiosk.config import BROWSERS
from app.tools.kiosk.judge import PageStatus

# The Chrome DevTools Protocol over a pipe (`--remote-debugging-pipe`): JSON messages, each ended by a
# zero byte. Chromium reads descriptor 3 and writes descriptor 4; no port is opened.
#
# Source: https://chromedevtools.github.io/devtools-protocol/

BROWSER_READS: Final = 3
BROWSER_WRITES: Final = 4
END: Final = b"\0"
LONGEST_MESSAGE: Final = 1 << 24  # bytes

Event = Mapping[str, Any]


class DevToolsError(Exception):
    """The browser refused a command, or is gone."""


class NoResponse(DevToolsError):
    """The browser, or its page, did not answer in time."""


class DevTools:
    """One browser's end of the protocol. `on_event` gets (method, parameters)."""

    def __init__(self, on_event: Callable[[str, Event], None]) -> None:
        self._on_event = on_event
        self._replies: dict[int, asyncio.Future[Event]] = {}
        self._last = 0
        self._reader: asyncio.ReadTransport | None = None
        self._writer: asyncio.WriteTransport | None = None
        self._reading: asyncio.Task[None] | None = None

    async def open(self, read_fd: int, write_fd: int) -> None:
        """Takes over both descriptors."""
        loop = asyncio.get_running_loop()
        reader = asyncio.StreamReader(limit=LONGEST_MESSAGE)
        self._reader, _ = await loop.connect_read_pipe(
            lambda: asyncio.StreamReaderProtocol(reader), os.fdopen(read_fd, "rb", 0)
        )
        self._writer, _ = await loop.connect_write_pipe(
            asyncio.BaseProtocol, os.fdopen(write_fd, "wb", 0)
        )
        self._reading = asyncio.create_task(self._read(reader))

    async def call(
        self, method: str, timeout_s: float, session: str = "", **params: Any
    ) -> dict[str, Any]:
        """The result of a command; NoResponse if there is none within `timeout_s`."""
        if self._writer is None or self._writer.is_closing():
            raise DevToolsError(f"{method}: the browser is gone")
        self._last += 1
        number = self._last
        message = {"id": number, "method": method, "params": params}
        if session:
            message["sessionId"] = session
        self._replies[number] = reply = asyncio.get_running_loop().create_future()
        self._writer.write(json.dumps(message).encode() + END)
        try:
            async with asyncio.timeout(timeout_s):  # wait_for of Python 3.11 may lose a cancellation
                response = await reply
        except TimeoutError:
            raise NoResponse(f"{method}: no response within {timeout_s:g} s") from None
        finally:
            self._replies.pop(number, None)
        if "error" in response:
            raise DevToolsError(f"{method}: {response['error'].get('message')}")
        return dict(response["result"])

    def close(self) -> None:
        for transport in (self._writer, self._reader):
            if transport is not None and not transport.is_closing():
                transport.close()
        if self._reading is not None:
            self._reading.cancel()
        self._fail()

    async def _read(self, reader: asyncio.StreamReader) -> None:
        try:
            while True:
                self._received(json.loads((await reader.readuntil(END))[:-1]))
        except (asyncio.IncompleteReadError, OSError):  # the browser has ended
            self._fail()

    def _received(self, message: Event) -> None:
        reply = self._replies.get(message.get("id", 0))
        if reply is not None and not reply.done():
            reply.set_result(message)
        elif "method" in message:
            self._on_event(message["method"], message.get("params", {}))

    def _fail(self) -> None:
        for reply in self._replies.values():
            if not reply.done():
                reply.set_exception(DevToolsError("the browser is gone"))


# What runs in each page of the kiosk: the look of the watcher, and the keys that lead nowhere.

DRAWS_WITHIN_MS: Final = 1500

# A page with a stream whose scripts did not load is as old as its document.
LOOK: Final = f"""(async () => {{
    const drawn = await new Promise((done) => {{
        requestAnimationFrame(() => done(true));
        setTimeout(() => done(false), {DRAWS_WITHIN_MS});
    }});
    const streams = document.getElementById("page") !== null;
    const ageMs = window.operatorPanel ? window.operatorPanel.eventAgeMs() : performance.now();
    return {{
        url: location.href,
        ours: "theme" in document.documentElement.dataset,
        age_s: streams ? ageMs / 1000 : null,
        drawn,
    }};
}})()"""

# The browser's shortcuts, its context menu, zoom and history. Editing in a text field stays.
KEEP_IN: Final = """(() => {
    const EDITS = /^([acvxyz]|Arrow.*|Backspace|Delete|Home|End)$/i;
    const LEADS_OUT = /^(F\\d+|(Browser|Launch|Zoom).*|Open|New|Print|Save|Close|Help|Find|.*Menu)$/;
    const stop = (event) => event.preventDefault();
    addEventListener("keydown", (event) => {
        const edits = event.ctrlKey && !event.altKey && !event.metaKey && EDITS.test(event.key);
        const combined = event.ctrlKey || event.altKey || event.metaKey;
        if ((combined && !edits) || LEADS_OUT.test(event.key)) stop(event);
    }, true);
    addEventListener("contextmenu", stop, true);
    addEventListener("wheel", (event) => event.ctrlKey && stop(event), { passive: false });
    for (const name of ["mousedown", "mouseup"]) {
        addEventListener(name, (event) => event.button > 2 && stop(event), true);
    }
})()"""


# A child process with all that it starts: a session of its own, ended as a whole.

# Above the descriptors that a child's protocol names: duplicating one never closes another.
LOWEST_FD: Final = 10


def high_pipe() -> tuple[int, int]:
    """(read end, write end) of a pipe, both `LOWEST_FD` or more and closed on exec."""
    low = os.pipe()
    high = [fcntl.fcntl(fd, fcntl.F_DUPFD_CLOEXEC, LOWEST_FD) for fd in low]
    for fd in low:
        os.close(fd)
    return high[0], high[1]


class Child:
    """Runs from its making. `ended` is set when the process has exited."""

    def __init__(
        self, command: Sequence[str], env: Mapping[str, str], inherited: Mapping[int, int] | None = None
    ) -> None:
        """`inherited` maps descriptors of this process to numbers in the child. OSError if the program
        can't be started."""
        actions = [(os.POSIX_SPAWN_DUP2, mine, its) for mine, its in (inherited or {}).items()]
        self.pid = os.posix_spawnp(
            command[0],
            list(command),
            dict(env),
            file_actions=actions,
            setsid=True,
            setsigdef=[signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGPIPE],
        )
        self.ended = asyncio.Event()
        self._pidfd = os.pidfd_open(self.pid)
        asyncio.get_running_loop().add_reader(self._pidfd, self._reap)

    @property
    def runs(self) -> bool:
        return not self.ended.is_set()

    async def end(self, grace_s: float = 0.0) -> None:
        """Ends the process and its session: by SIGTERM and, after `grace_s`, by SIGKILL."""
        if grace_s and self.runs:
            os.kill(self.pid, signal.SIGTERM)
            with suppress(TimeoutError):
                async with asyncio.timeout(grace_s):
                    await self.ended.wait()
        with suppress(ProcessLookupError):
            os.killpg(self.pid, signal.SIGKILL)  # what it started may live on
        await self.ended.wait()

    def _reap(self) -> None:
        asyncio.get_running_loop().remove_reader(self._pidfd)
        os.close(self._pidfd)
        os.waitpid(self.pid, 0)
        self.ended.set()


# Chromium as the kiosk has it: its flags, its one page, and what is seen of it.

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
            seen = await self.evaluate(LOOK)
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

    async def set_cookies(self, url: str, cookies: Mapping[str, str]) -> None:
        """The pages of an address have these cookies from now on."""
        for name, value in cookies.items():
            call = self._call("Network.setCookie", self._session, name=name, value=value, url=url)
            await call

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

    async def evaluate(self, expression: str) -> dict[str, Any]:
        """What an expression of the page makes, an object; DevToolsError if it throws."""
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

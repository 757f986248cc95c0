"""What a browser shows of a control: Chromium without a window, by the kiosk's DevTools protocol."""

import asyncio
import os
import threading
import time
from collections.abc import Callable, Coroutine
from pathlib import Path
from typing import Any, Final, NamedTuple, TypeVar

from app.system.errors import SettingsError
from app.tools.kiosk.browser import Browser, DevToolsError, find_browser

ANSWER_WITHIN_S: Final = 40.0
POLL_S: Final = 0.05
FLAGS: Final = ("--headless=new", "--window-size=1280,800", "--disable-gpu", "--disable-dev-shm-usage")
# Of a control: whether each of its buttons is locked, and all that is said of it.
SEEN: Final = r"""(() => {
    const root = document.querySelector(`[data-widget="%s"]`);
    const presses = ({ className, formAction = "" }) =>
        className === "hold" || /\/widgets\/\w+(\?.*)?$/.test(formAction);
    const buttons = root ? [...root.querySelectorAll("button")] : [];
    const isLocked = (button) => button.disabled || button.getAttribute("aria-disabled") === "true";
    const pressing = buttons.filter((button) => presses(button) && !button.closest(".ask"));
    const texts = pressing.flatMap((button) => [
        button.textContent,
        ...(button.getAttribute("aria-describedby") ?? "").split(" ").map((id) =>
            id ? (document.getElementById(id)?.textContent ?? "") : ""),
    ]);
    return {
        count: pressing.length,
        locked: pressing.every(isLocked),
        text: [root?.textContent ?? "", ...texts].join(" "),
        url: location.href,
    };
})()"""

Answer = TypeVar("Answer")


class Seen(NamedTuple):
    """Whether the page shows a control as locked, None if it has no button for it; and its texts."""

    locked: bool | None
    text: str


class PageView:
    """One browser with one page, from `__enter__` to `__exit__`. Used by one thread."""

    def __init__(self, profile: Path) -> None:
        """SettingsError if there is no browser."""
        flags = (*FLAGS, "--no-sandbox") if os.geteuid() == 0 else FLAGS
        self._program = find_browser("")
        profile.mkdir(parents=True, exist_ok=True)
        self._env = {**os.environ, "TMPDIR": str(profile)}  # what it leaves goes with its profile
        self._browser = Browser(self._program, flags, profile)
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(
            target=self._loop.run_forever, name="prove-browser", daemon=True
        )
        self._url = ""

    def __enter__(self) -> "PageView":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._run(self._browser.end())
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(ANSWER_WITHIN_S)
        self._loop.close()

    def open(self, url: str, cookie: str) -> None:
        """Opens a page, unless it is open, as the client with this cookie."""
        if url == self._url:
            return
        if not self._url:
            self._run(self._browser.start("about:blank", self._env))
            cookies = dict(each.split("=", 1) for each in cookie.split("; ") if each)
            self._run(self._browser.set_cookies(url, cookies))
        self._run(self._browser.open(url))
        self._url = url

    def seen(self, control: str) -> Seen:
        """What the open page shows of a control now."""
        try:
            seen = self._run(self._browser.evaluate(SEEN % control))
        except DevToolsError:  # between two pages
            return Seen(None, "")
        if not str(seen["url"]).startswith(self._url):
            return Seen(None, "")
        return Seen(bool(seen["locked"]) if seen["count"] else None, str(seen["text"]))

    def shows(self, control: str, is_right: Callable[[Seen], bool], within_s: float) -> Seen:
        """The same as soon as it is right, or at the end of the time."""
        end = time.monotonic() + within_s
        while not is_right(seen := self.seen(control)) and time.monotonic() < end:
            time.sleep(POLL_S)
        return seen

    def _run(self, work: Coroutine[Any, Any, Answer]) -> Answer:
        return asyncio.run_coroutine_threadsafe(work, self._loop).result(ANSWER_WITHIN_S)


def has_browser() -> str:
    """The name of the browser's program; "" without one."""
    try:
        return Path(find_browser("")).name
    except SettingsError:
        return ""

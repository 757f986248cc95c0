"""A Chromium that nobody is attached to while it is measured, as on a kiosk: whoever drives one through
the DevTools makes it tell of every frame, which takes a fifth of what it costs."""

import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from playwright.sync_api import Page, Playwright

from bench.parts import ENDS_WITHIN_S, ended, family
from tests.support.parts import CHROMIUM, CHROMIUM_FLAGS

STARTS_WITHIN_S: Final = 15.0


class Unattended:
    """One page of one browser, in front; it is spoken to before and after, never in the meantime."""

    def __init__(self, playwright: Playwright, profile: Path) -> None:
        """`profile` is a folder of its own."""
        self._playwright = playwright
        self._port_file = profile / "DevToolsActivePort"
        self._process = subprocess.Popen(
            [
                CHROMIUM,
                *CHROMIUM_FLAGS,
                "--headless=new",
                "--window-size=1280,800",
                f"--user-data-dir={profile}",
                "--remote-debugging-port=0",
                "about:blank",
            ],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )

    def pids(self) -> set[int]:
        return family((self._process.pid,))

    @contextmanager
    def attached(self) -> Iterator[Page]:
        """Its page, which stays as it is."""
        browser = self._playwright.chromium.connect_over_cdp(f"http://127.0.0.1:{self._port()}")
        try:
            yield browser.contexts[0].pages[0]
        finally:
            browser.close()  # the connection alone

    def _port(self) -> int:
        end = time.monotonic() + STARTS_WITHIN_S
        while time.monotonic() < end:
            if self._port_file.exists() and (told := self._port_file.read_text().split()):
                return int(told[0])
            time.sleep(0.05)
        raise TimeoutError(f"Chromium did not tell its port within {STARTS_WITHIN_S:g} s")

    def close(self) -> None:
        """Returns when none of its processes writes into the profile any more."""
        pids = self.pids()
        ended(self._process)
        end = time.monotonic() + ENDS_WITHIN_S
        while any(Path(f"/proc/{pid}").exists() for pid in pids) and time.monotonic() < end:
            time.sleep(0.02)

"""A Chromium without an attached DevTools client during the measurement, as on a kiosk: reporting every
frame to DevTools would take a fifth of its CPU time."""

import os
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from playwright.sync_api import Page, Playwright

from bench.parts import ENDS_WITHIN_S, end_process, family
from tests.support.parts import CHROMIUM, CHROMIUM_FLAGS

STARTS_WITHIN_S: Final = 15.0


class Unattended:
    """One browser with one page in the foreground. DevTools are attached before and after a measurement
    only."""

    def __init__(self, playwright: Playwright, profile: Path, url: str = "about:blank") -> None:
        """`profile` is an empty folder."""
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
                url,
            ],
            env={**os.environ, "TMPDIR": str(profile)},  # it leaves a folder there
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )

    def pids(self) -> set[int]:
        return family((self._process.pid,))

    @contextmanager
    def attached(self) -> Iterator[Page]:
        """Attaches DevTools within the block; yields the page, which stays open."""
        browser = self._playwright.chromium.connect_over_cdp(f"http://127.0.0.1:{self._port()}")
        try:
            yield browser.contexts[0].pages[0]
        finally:
            browser.close()  # closes only the connection

    def _port(self) -> int:
        end = time.monotonic() + STARTS_WITHIN_S
        while time.monotonic() < end:
            if self._port_file.exists() and (words := self._port_file.read_text().split()):
                return int(words[0])
            time.sleep(0.05)
        raise TimeoutError(f"Chromium did not report its port within {STARTS_WITHIN_S:g} s")

    def close(self) -> None:
        """Ends the browser, and waits until no process writes to the profile."""
        pids = self.pids()
        end_process(self._process)
        end = time.monotonic() + ENDS_WITHIN_S
        while any(Path(f"/proc/{pid}").exists() for pid in pids) and time.monotonic() < end:
            time.sleep(0.02)

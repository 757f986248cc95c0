"""A person at the terminal of a live proof."""

import os
import pty
import select
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final

from tests.support.parts import ROOT

WITHIN_S: Final = 60.0  # on a busy machine


class Person:
    """`operator-panel prove` at a pseudo terminal, with what it has said."""

    def __init__(self, panel: Path, url: str, *options: str, by: str = "M. Sato") -> None:
        self._master, slave = pty.openpty()
        words = [sys.executable, "-m", "app.cli", "prove", str(panel), "--live", url, "--by", by]
        self.process = subprocess.Popen(
            [*words, *options], cwd=ROOT, stdin=slave, stdout=slave, stderr=slave,
            env={**os.environ, "PYTHONPATH": str(ROOT)}, start_new_session=True,
            # Where the tests run in the background, it would ignore Ctrl-C as they do.
            preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
        )  # fmt: skip
        os.close(slave)
        self.said = ""
        self.robot = ""  # of the step that began last
        self._read = 0

    def hears(self, *texts: str) -> str:
        """The first of some texts, when it is said after what was heard before."""
        end = time.monotonic() + WITHIN_S
        while True:
            heard = [(self.said.find(text, self._read), text) for text in texts]
            if first := min(((at, text) for at, text in heard if at >= 0), default=None):
                self._read = first[0] + len(first[1])
                return first[1]
            left_s = end - time.monotonic()
            assert left_s > 0, f"{texts} not in:\n{self.said[self._read :]}"
            assert self._more(left_s), f"it ended without {texts}:\n{self.said}"

    def _more(self, within_s: float) -> bool:
        if not select.select([self._master], [], [], within_s)[0]:
            return True
        try:
            data = os.read(self._master, 65_536)
        except OSError:  # the other end is closed
            return False
        self.said += data.decode().replace("\r\n", "\n")
        return bool(data)

    def types(self, keys: str) -> None:
        os.write(self._master, keys.encode())

    def step(self) -> str:
        """The title of the step that begins, "" if there is none any more."""
        if self.hears("\nStep ", " cases: ", '{\n  "panel"') != "\nStep ":
            return ""
        start = self._read
        self.hears(": ")
        self.robot = self.said[start : self._read - 2].partition(", robot ")[2]
        start = self._read
        self.hears("\n")
        title = self.said[start : self._read].strip()
        self.hears("for now\n")
        return title

    def sees(self, rows: Sequence[str]) -> None:
        """Each of these cases was measured as it must be."""
        for row in rows:
            start = self._read
            self.hears(f"panel: {row} ✓")
            self._read = start

    def ticks(self) -> None:
        self.types("t")
        self.hears("kept: tick\n")

    def ends(self, with_signal: signal.Signals | None = None) -> int:
        """Its exit status, after all that it says."""
        if with_signal is not None:
            self.process.send_signal(with_signal)
        end = time.monotonic() + WITHIN_S
        while self._more(1.0):
            assert time.monotonic() < end, self.said
        os.close(self._master)
        return self.process.wait(WITHIN_S)

    def close(self) -> None:
        """Ends it, wherever it is."""
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
            with suppress(OSError):
                os.close(self._master)

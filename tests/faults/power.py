"""`python -m tests.faults.power [CUTS]`: the power is cut while the operator's log is written.

The data folder is on an ext4 file system of its own, which is shut down without writing what its
journal still has in memory: only what was synced to the disk is left, as after a real cut. Afterwards
the log must be as it was written, and have each press whose receipt an operator could read. Needs root
and loop devices. Prints a line for each cut, and fails at the first loss.
"""

import csv
import fcntl
import io
import os
import random
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from struct import pack
from typing import Final

import httpx

from tests.faults.results import record
from tests.support.parts import ROOT, Server, until

SHUTDOWN: Final = 0x8004587D  # EXT4_IOC_SHUTDOWN, linux/ext4.h
WITHOUT_JOURNAL: Final = pack("I", 2)  # EXT4_GOING_FLAGS_NOLOGFLUSH
SIZE: Final = 64 << 20
MOST_PRESSES: Final = 40
UNLOGGED: Final = "Not safely in the operator's log"


class Disk:
    """A file system in a file."""

    def __init__(self, folder: Path) -> None:
        self._image, self.folder = folder / "image", folder / "data"
        self.folder.mkdir()
        with self._image.open("wb") as image:
            image.truncate(SIZE)
        subprocess.run(["mkfs.ext4", "-q", str(self._image)], check=True)

    @contextmanager
    def mounted(self) -> Iterator[Path]:
        attach = ["losetup", "--find", "--show", str(self._image)]
        device = subprocess.check_output(attach, text=True).strip()
        try:
            subprocess.run(["mount", device, str(self.folder)], check=True)
            try:
                yield self.folder
            finally:
                subprocess.run(["umount", str(self.folder)], check=True)
        finally:
            subprocess.run(["losetup", "--detach", device], check=True)

    def cut(self) -> None:
        """From now on nothing is written, nor what is still in memory."""
        folder = os.open(self.folder, os.O_RDONLY)
        try:
            fcntl.ioctl(folder, SHUTDOWN, WITHOUT_JOURNAL)
        finally:
            os.close(folder)


class Presses:
    """Presses one after the other, each with a text of its own; `sent` are those whose receipt does not
    say that the log could not be written."""

    def __init__(self, server: Server) -> None:
        self._server = server
        self._ends = threading.Event()
        self._thread = threading.Thread(target=self._press)
        self.sent: list[str] = []
        self.refused = 0

    def _press(self) -> None:
        number = 0
        while not self._ends.is_set():
            number += 1
            with suppress(httpx.TransportError):
                answer = self._server.press("operation", f"press {number}")
                if answer.status_code != 200:
                    self.refused += 1
                elif UNLOGGED not in answer.json()["reason"]:
                    self.sent.append(f"press {number}")

    def __enter__(self) -> "Presses":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ends.set()
        self._thread.join()


def logged(server: Server) -> set[str]:
    """The texts of the presses that were sent, as the log's export has them."""
    rows = csv.DictReader(io.StringIO(server.http.get("/log.csv").text))
    sent = [row["values"] for row in rows if row["outcome"] == "published"]
    return {text for values in sent if (text := values.partition('"message": "')[2].partition('"')[0])}


def cut_once(folder: Path, presses_before: int) -> tuple[int, int]:
    """(presses with a receipt, entries in the log afterwards); AssertionError for a loss."""
    disk = Disk(folder)
    with disk.mounted() as data:
        server = Server(ROOT, KIOSK_DATA=str(data))
        try:
            until(server.ready, "ready")
            with Presses(server) as presses:
                until(lambda: len(presses.sent) >= presses_before, "presses are logged")
                receipts = list(presses.sent)  # of a press at the cut none could be read
                disk.cut()
                until(lambda: presses.refused > 0, "presses are refused without a log")
                assert server.widget("operation")["enabled"] is False
        finally:
            server.process.kill()
    with disk.mounted() as data:
        verify = [sys.executable, "-m", "app.log", "verify", "--data", str(data)]
        verified = subprocess.run(verify, cwd=ROOT, capture_output=True, text=True, check=False)
        assert verified.returncode == 0, verified.stdout + verified.stderr
        server = Server(ROOT, KIOSK_DATA=str(data))
        try:
            until(server.ready, "ready again")
            lost = set(receipts) - logged(server)
            assert not lost, f"the log lost {sorted(lost)}"
            assert server.press("operation", "afterwards").status_code == 200
        finally:
            server.end()
    return len(receipts), int(verified.stdout.split()[1])


def main(cuts: int = 20) -> None:
    pick = random.Random(1)
    total = 0
    for number in range(cuts):
        with tempfile.TemporaryDirectory(prefix="power-") as folder:
            sent, entries = cut_once(Path(folder), pick.randint(1, MOST_PRESSES))
        total += sent
        print(f"cut {number + 1}: {sent} presses with a receipt, {entries} entries left", flush=True)
    record(
        f"power cut {cuts} times",
        locked="at once: nothing is sent without the log",
        presses=f"{total} with a receipt, each of them in the log",
        after="the log is as it was written",
    )


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))

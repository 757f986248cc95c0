"""Watches the server of a panel over HTTP: its events, and the entries of its operator's log. It
presses nothing and changes nothing."""

import csv
import html
import io
import re
import threading
import time
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Final
from urllib.parse import urlencode

from app.system.errors import KioskError
from app.system.texts import render
from app.tools.editor.kiosk_client import KioskClient, KioskRefused
from app.tools.prove.shown import Shown, read_events

SILENT_AFTER_S: Final = 5.0  # of a stream that has two beats a second
AGAIN_S: Final = 1.0
LOG_EVERY_S: Final = 1.0  # others export it too, one at a time
BUSY: Final = 429
FIRST_WITHIN_S: Final = 15.0
MET: Final = re.compile(r'<li data-met="met">.*?</li>', re.DOTALL)  # an interlock that permits
TAG: Final = re.compile(r"<[^>]*>")
SPACES: Final = re.compile(r"\s+")
Entry = Mapping[str, str]  # a row of the log as CSV, by its columns


class PanelWatch:
    """What the server shows of a robot, from `start` to `close`. `lost` is why nothing is received now,
    "" while it is; `log_fault` the same of the log. Both are set by its own threads."""

    def __init__(
        self, client: KioskClient, robot: str = "", robot_name: str = "", *, reads_log: bool = True
    ) -> None:
        """`robot` is the id of one of several robots, `robot_name` its name in the log."""
        self._client = client
        self.robot = robot
        self._root = f"/robots/{robot}" if robot else ""
        self._robot_name = robot_name
        self.shown = Shown()
        self.lost = "nothing was received yet"
        self.log_fault = ""
        self._began = 0.0  # of the entries that are read, seconds since 1970 of the server's clock
        self._entries: Sequence[Entry] = ()
        self._entries_at = 0.0  # when they were asked for, in monotonic seconds
        self._reads_log = reads_log
        self._ends = threading.Event()

    def start(self) -> None:
        """KioskError if the server or its log can't be read."""
        for work in (
            (self._follow_events, self._follow_log) if self._reads_log else (self._follow_events,)
        ):
            threading.Thread(target=work, name="prove-watch", daemon=True).start()
        end = time.monotonic() + FIRST_WITHIN_S
        while self.lost or (self._reads_log and not self._entries_at):
            if time.monotonic() > end or self.log_fault:
                self.close()
                raise KioskError(self.log_fault or self.lost)
            time.sleep(0.05)

    def close(self) -> None:
        self._ends.set()

    def begin(self) -> None:
        """The entries of the log from now on are those of a step."""
        self._entries, self._began = (), self.server_time

    @property
    def server_time(self) -> float:
        """Seconds since 1970 of the server's clock."""
        return time.monotonic() + self.shown.ahead_s

    def entries(self, control: str) -> list[Entry]:
        """The entries of a control since `begin`, in order."""
        own = [entry for entry in self._entries if entry["widget"] == control]
        return [entry for entry in own if entry["robot"] in ("", self._robot_name)][::-1]

    def has_read_log(self, within_s: float) -> bool:
        """Waits until the entries up to now are read."""
        now, end = time.monotonic(), time.monotonic() + within_s
        while self._entries_at < now and time.monotonic() < end:
            time.sleep(0.02)
        return self._entries_at >= now

    def lock_text(self, control: str) -> str:
        """Why a control is locked, as the page says beside it, also to a client without control."""
        try:
            text = self._client.text(f"{self._root}/widgets/{control}/lock", SILENT_AFTER_S)
        except KioskRefused:
            return ""
        return SPACES.sub(" ", html.unescape(TAG.sub(" ", MET.sub("", text)))).strip()

    def _follow_events(self) -> None:
        while not self._ends.is_set():
            try:
                with self._client.lines(f"{self._root}/events", SILENT_AFTER_S) as lines:
                    for event in read_events(lines):
                        self.shown.take(event)
                        if self._ends.is_set():
                            return
                        self.lost = ""
                self.lost = "the server has ended the stream of events"
            except KioskRefused as refused:
                self.lost = render(refused.text)
            except (ValueError, KeyError, TypeError):
                self.lost = "that is not a panel server"
            self._ends.wait(AGAIN_S)

    def _follow_log(self) -> None:
        while not self._ends.wait(LOG_EVERY_S if self._entries_at else 0.05):
            if self.lost:
                continue
            asked, began = time.monotonic(), self._began
            since = datetime.fromtimestamp(began or self.server_time, UTC).isoformat(
                timespec="milliseconds"
            )
            query = urlencode({"since": since, "every": "true"})
            try:
                text = self._client.text(f"/log.csv?{query}")
            except KioskRefused as refused:
                if refused.status not in (0, BUSY) and not self._entries_at:
                    self.log_fault = f"the operator's log can't be read: {render(refused.text)}"
                continue
            if began == self._began:  # else they are of the step before
                self._entries = list(csv.DictReader(io.StringIO(text.removeprefix("\ufeff"))))
                self._entries_at = asked

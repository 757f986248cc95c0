"""A cell's data folder with an operator's log, alarms, states and trends, without a server."""

import json
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Final
from unittest.mock import patch

from app.cell.alarms.history import HistoryRow
from app.cell.alarms.report import NAME as STATES
from app.cell.alarms.report import StateRow, write_states
from app.cell.alarms.store import NAME as ALARMS
from app.cell.alarms.store import AlarmStore
from app.cell.history.trends import FieldName, TrendFile
from app.cell.robot.history import Bucket
from app.records.entry import Entry, Kind, new_entry
from app.records.log_key import Signer, load_or_make_key
from app.records.store import Store

START: Final = time.time() // 60 * 60 - 86_400.0  # a whole minute of yesterday
SPEED: Final[FieldName] = ("", "/speed", "std_msgs/msg/Float64", "data")


class CellData:
    """The data folder; each method adds to its stores, as a server does."""

    def __init__(self, folder: Path, start: float = START) -> None:
        folder.mkdir(exist_ok=True)
        self.folder = folder
        self._start = start
        self._count = 0
        self.key = load_or_make_key(folder).public
        self._log = Store(folder, "boot")
        self._signer = Signer(folder)

    def close(self) -> None:
        self._log.complete()
        self._log.close()

    def press(self, count: int, step_s: float = 1.0, kind: Kind = "pressed") -> None:
        """Adds presses, each of them `step_s` after the one before; a server closes those that are
        `pressed`."""
        entries = []
        for _ in range(count):
            self._count += 1
            entry = new_entry(
                kind,
                values={"n": self._count},
                reason="Ok",
                press=f"{self._count:032x}",
                widget="start",
                action="press",
                who="Ann",
            )
            entries.append(entry._replace(at=round((self._start + self._count * step_s) * 1000)))
        self._log.append(entries)

    def add(self, entry: Entry) -> None:
        self._log.append([entry])

    def sign(self) -> None:
        """Adds the signature of the newest entry."""
        self._signer.sign(self._log, "hour")

    def sign_at(self, after_s: float) -> None:
        """Adds a signature that was made so long after the start."""
        at = round((self._start + after_s) * 1000)
        with patch("app.records.entry._now", lambda: (at, 0)):
            self._log.append([load_or_make_key(self.folder).entry(self._log.head, "hour")])

    def remove_before(self, days: float, now_s: float) -> None:
        """Removes old entries, by the log's own rule."""
        while self._log.remove_old(days, 1e6, round(now_s * 1000)):
            pass

    def alarm(self, count: int, first: int = 1) -> None:
        store = AlarmStore(self.folder / ALARMS, days=1000, size_mb=64)
        store.write([self._row(number) for number in range(first, first + count)], {})
        store.close()

    def _row(self, number: int) -> HistoryRow:
        record = {
            "state": "unacknowledged",
            "unknown_since": None,
            "raised_at": self._start,
            "value": 4.5,
            "limit": 5.0,
            "source": "limits",
            "about": {
                "text": f"Air {number} low",
                "action": "",
                "group": "air",
                "priority": 2,
                "unit": "",
            },
        }
        at = self._start + number
        return HistoryRow(
            at, f"air{number}", "active", number, "", "", json.dumps(record), "raised", 2, "", "air"
        )

    def states(self, names: Sequence[str]) -> None:
        """Adds states, ten seconds each; "" for a time without a record."""
        rows = []
        for number, name in enumerate(names):
            state = json.dumps({"text": name, "shape": "run", "colour": "green"}) if name else ""
            rows.append(StateRow(self._start + 10 * number, "", state))
        write_states(self.folder / STATES, rows, [])

    def trend(self, values: Sequence[float], width: int = 1, start: float = 0.0) -> None:
        """Adds a value for each `width` seconds."""
        file = TrendFile(self.folder)
        begin = start or self._start
        buckets = [
            Bucket(begin + number * width, value - 1, value + 1, value, gap=False)
            for number, value in enumerate(values)
        ]
        file.write({SPEED: {width: buckets}}, {}, begin)
        file.close()

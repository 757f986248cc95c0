"""Compares the operator's log with its copy: the file of `KIOSK_LOG_COPY`, or what a syslog server has
written. A copy has one entry a line, as JSON; other lines are left out."""

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

from app.audit.entry import FIELDS, Entry
from app.errors import LogError

BEGIN: Final = '{"seq":'
ROTATED: Final = ".1"


def as_line(entry: Entry) -> str:
    """An entry as a line of a copy, without the line's end."""
    return json.dumps(entry._asdict(), ensure_ascii=False, separators=(",", ":"))


def parse_line(line: str) -> Entry | None:
    """The entry in a line, also behind what a syslog server writes before it; None without one."""
    at = line.find(BEGIN)
    if at < 0:
        return None
    try:
        about: Mapping[str, Any] = json.JSONDecoder().raw_decode(line, at)[0]
        return Entry(**{name: about[name] for name in FIELDS})
    except (ValueError, KeyError, TypeError):
        return None


def read_copy(path: Path) -> Iterator[Entry]:
    """The entries of a copy and of its rotated part, in their order; LogError."""
    try:
        for part in (path.with_name(path.name + ROTATED), path):
            if part == path or part.exists():
                with part.open(encoding="utf-8", errors="replace") as file:
                    yield from filter(None, map(parse_line, file))
    except OSError as error:
        raise LogError(f"the copy {path} can't be read: {error.strerror}") from error


class Comparison:
    """Compares entries in turn with those of a copy, which are kept by their hashes."""

    def __init__(self, copied: Iterator[Entry]) -> None:
        self._hashes: dict[int, str] = {}
        self.replaced = 0  # the first number of which the copy has two entries
        for entry in copied:
            known = self._hashes.setdefault(entry.seq, entry.hash)
            if known != entry.hash and not self.replaced:
                self.replaced = entry.seq
        self.count = len(self._hashes)
        self._last = max(self._hashes, default=0)
        self._newest = 0

    def fault(self, entry: Entry) -> str:
        """What is wrong with an entry of the log by the copy, "" if nothing."""
        self._newest = entry.seq
        known = self._hashes.get(entry.seq)
        if known is None or known == entry.hash:
            return ""
        return f"entry {entry.seq} is another than in the copy: the log was rewritten or replaced"

    def end_fault(self) -> str:
        """What is wrong with the whole, after the last entry of the log."""
        if self._last > self._newest:
            return (
                f"the copy has entries up to {self._last}, the log only up to {self._newest}: its"
                " newest entries were removed, or an older copy of the log is in its place"
            )
        if self.replaced:
            return (
                f"the copy has two different entries {self.replaced}: the log was replaced by another"
                " while the copy was made"
            )
        return ""

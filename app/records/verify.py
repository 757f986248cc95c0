"""Verifies the hash chain of the operator's log, and its signatures.

The chain alone does not show the removal of the newest entries, or a log that was rewritten as a whole.
The signatures show a log that was rewritten without the key. For the removal of the newest entries, a
copy of the log or an earlier head is needed from elsewhere.
"""

import json
import sqlite3
from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from app.records.database import as_log_error, entry_count, open_read_only
from app.records.entry import Entry
from app.records.log_key import is_signed, read_signature
from app.records.store import COLUMNS
from app.system.errors import LogError

# Up to where the signatures in the operator's log prove it. Pure but for the signatures' check.

# The server signs every hour. Entries that stand unsigned for longer while it runs are not its work.
LONGEST_UNSIGNED_US: Final = 2 * 3_600_000_000


@dataclass(frozen=True, slots=True)
class Signed:
    """The entries up to `seq`, 0 for none, are proven by a signature of the time `at` (ms) with `key`.
    `unsigned` is how many follow it, without the signature's own."""

    seq: int = 0
    at: int = 0
    key: str = ""
    unsigned: int = 0


class SignedPart:
    """Checks the entries in turn, the oldest first. Only `keys` may sign; without keys, the first that
    signs is the only one."""

    def __init__(self, keys: Collection[str] = ()) -> None:
        self._keys = frozenset(keys)
        self._signed = Signed()
        self._unsigned = 0
        self._since: Entry | None = None  # the oldest unsigned entry of this server

    @property
    def result(self) -> Signed:
        signed = self._signed
        return Signed(signed.seq, signed.at, signed.key, self._unsigned)

    def fault(self, entry: Entry) -> str:
        """What is wrong with this entry, "" if nothing."""
        if entry.kind == "signed":
            return self._signature_fault(entry)
        self._unsigned += 1
        if self._since is None or self._since.boot != entry.boot:
            self._since = entry
            return ""
        ran = entry.monotonic - self._since.monotonic
        if self._signed.key and ran > LONGEST_UNSIGNED_US:
            return (
                f"entry {self._since.seq} and those after it are not signed, though the server ran on"
                f" for {ran // 3_600_000_000} hours and signs every hour: signatures were removed, or"
                " the key could not be read"
            )
        return ""

    def end_fault(self) -> str:
        """What is wrong with the whole, after the last entry."""
        if self._keys and not self._signed.key:
            return f"no entry is signed with the key {', '.join(sorted(self._keys))}"
        return ""

    def _signature_fault(self, entry: Entry) -> str:
        signature = read_signature(entry)
        if signature is None:
            return f"entry {entry.seq} has no signature that can be read"
        if (signature.seq, signature.hash) != (entry.seq - 1, entry.prev):
            return f"the signature in entry {entry.seq} is of another entry than the one before it"
        if not is_signed(signature, entry.at):
            return f"the signature in entry {entry.seq} does not fit: entries before it were changed"
        if self._keys and signature.key not in self._keys:
            return f"entry {entry.seq} is signed with another key, {signature.key}"
        if not self._keys and self._signed.key not in ("", signature.key):
            return (
                f"entry {entry.seq} is signed with the key {signature.key}, those before with"
                f" {self._signed.key}: if the key was replaced, name both with --key"
            )
        self._signed = Signed(signature.seq, entry.at, signature.key)
        self._unsigned, self._since = 0, None
        return ""


NONE_SIGNED: Final = Signed()


# Called with the entries that are verified so far, and all of them.
Progress = Callable[[int, int], None]
REPORTED_EVERY: Final = 10_000  # entries


def no_progress(count: int, total: int) -> None:
    """For those that show none."""


@dataclass(frozen=True, slots=True)
class Verified:
    """The result: `fault` names the first entry that was changed, "" if there is none."""

    count: int
    head: str
    fault: str = ""
    signed: Signed = NONE_SIGNED


def verify(
    folder: Path,
    known_head: str = "",
    keys: Collection[str] = (),
    against: Callable[[Entry], str] | None = None,
    progress: Progress = no_progress,
) -> Verified:
    """Verifies the whole log at this moment, that `known_head`, if given, is in it, and that only
    `keys` signed it, if given. `against` returns the fault of an entry by a copy, "" if there is none.
    `progress` is called now and then. LogError if the log can't be read."""
    db = open_read_only(folder)
    try:
        with as_log_error():
            db.execute("BEGIN")
            (genesis,) = db.execute("SELECT value FROM about WHERE key = 'genesis'").fetchone() or ("",)
            entries = _reported(_entries(db), entry_count(db), progress)
            return Chain(genesis, known_head, SignedPart(keys), against).check(entries)
    finally:
        db.close()


def _reported(entries: Iterator[Entry], total: int, progress: Progress) -> Iterator[Entry]:
    for number, entry in enumerate(entries):
        if number % REPORTED_EVERY == 0 and number:
            progress(number, max(number, total))
        yield entry


def _entries(db: sqlite3.Connection) -> Iterator[Entry]:
    for row in db.execute(f"SELECT {COLUMNS} FROM entry ORDER BY seq"):
        try:
            yield Entry(*row)
        except (TypeError, ValueError) as error:
            raise LogError(f"the file has what is no entry: {error}") from error


class Chain:
    """Verifies entries from the oldest on; keeps only the last two hashes."""

    def __init__(
        self,
        genesis: str,
        known_head: str,
        signed: SignedPart,
        against: Callable[[Entry], str] | None = None,
    ) -> None:
        self._genesis = genesis
        self._known_head = known_head
        self._signed = signed
        self._against = against
        self._first: Entry | None = None
        self._begins = False
        self._kinds: set[str] = set()
        self._last = ("", genesis)  # the hashes of the one before the last, and of the last
        self._seq = 0
        self._count = 0

    def check(self, entries: Iterable[Entry]) -> Verified:
        """Verifies all entries, up to the first fault."""
        for entry in entries:
            if fault := self.fault(entry):
                return self._verified(fault)
        return self._verified(self.end_fault())

    def fault(self, entry: Entry) -> str:
        """What is wrong with the next entry, "" if nothing; then it counts."""
        fault = self._fault(entry) or self._signed.fault(entry)
        if fault := fault or (self._against(entry) if self._against else ""):
            return fault
        self._first = self._first or entry
        if self._known_head in (entry.hash, entry.prev):
            self._known_head = ""
        self._begins = self._begins or self._explains_begin(self._first, entry)
        self._kinds.add(entry.kind)
        self._accept(entry)
        return ""

    def _accept(self, entry: Entry) -> None:
        self._last, self._seq = (entry.prev, entry.hash), entry.seq
        self._count += 1

    def begin_at(self, entry: Entry) -> str:
        """Goes on with an entry that had a fault, as the first of a chain that needs no explanation;
        returns what is wrong with it alone."""
        self._first, self._begins = None, True
        fault = self._fault(entry)
        self._first = entry
        self._accept(entry)
        return fault

    def end_fault(self) -> str:
        """What is wrong with the whole, after the last entry."""
        if self._first is None:
            return "it has no entries: a log begins with number 1, or says why not"
        if not self._begins:
            return (
                f"what stood before entry {self._first.seq} was removed, by none of the log's own rules"
            )
        if self._known_head:
            return f"no entry has the head {self._known_head}: the newest were removed"
        return self._signed.end_fault()

    def _verified(self, fault: str) -> Verified:
        return Verified(self._count, self._last[1], fault, self._signed.result)

    def _fault(self, entry: Entry) -> str:
        before, last = self._last
        if self._first is None:
            before, last = "", entry.prev
        elif entry.prev == before:
            return f"entry {self._seq} was inserted"
        elif entry.seq != self._seq + 1:
            gone = (self._seq + 1, entry.seq - 1)
            names = (
                f"entry {gone[0]} is" if gone[0] == gone[1] else f"entries {gone[0]} to {gone[1]} are"
            )
            return f"{names} missing"
        if entry.hash != entry.computed_hash():
            return f"entry {entry.seq} was changed, or is not in its place"
        if entry.prev != last:
            return f"entry {entry.seq} does not follow the one before it"
        return ""

    def _explains_begin(self, first: Entry, entry: Entry) -> bool:
        """Whether an entry shows that the log may begin with its first one. The genesis, which has no
        hash of its own, is enough for number 1 only."""
        if entry.kind == "removed":
            about = _values(entry)
            return (about.get("last"), about.get("hash")) == (first.seq - 1, first.prev)
        if first.prev != self._genesis:
            return False
        if first.seq == 1 or entry.kind != "began":
            return first.seq == 1
        if entry is first and _values(entry).get("first") == entry.seq:
            return True
        # As early versions wrote it: after the closing entries of earlier presses, without a mode.
        return self._kinds <= {"closed", "corrected"} and not _values(entry)


def _values(entry: Entry) -> dict[str, Any]:
    try:
        values = json.loads(entry.values)
    except ValueError:
        return {}
    return values if isinstance(values, dict) else {}

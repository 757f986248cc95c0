"""Up to where the signatures in the operator's log prove it. Pure but for the signatures' check."""

from collections.abc import Collection
from dataclasses import dataclass
from typing import Final

from app.audit.entry import Entry
from app.audit.log_key import is_signed, read_signature

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

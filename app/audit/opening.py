"""Opens the file of the operator's log, and makes the first entries after that."""

import json
import logging
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from app.audit.database import NAME, Head, as_log_error, make_room, set_aside
from app.audit.entry import Entry, new_entry
from app.audit.start_record import StartRecord
from app.audit.store import Store
from app.errors import LogCorrupt, LogError, LogGone
from app.i18n import TextLike, joined, say

log = logging.getLogger("kiosk.log")


class Opening:
    """Opens the file, again after each failure. Keeps the reason for a new file until it is written
    there."""

    def __init__(self, folder: Path, boot: str) -> None:
        self._folder = folder
        self._boot = boot
        self._cause: LogError | None = None
        self._new_file_reason: TextLike = ""

    def mark_lost(self, error: LogError) -> None:
        """The file was closed because of this error. An error that needs a new file is kept until there
        is one."""
        if not isinstance(self._cause, LogCorrupt | LogGone):
            self._cause = error

    def store(self, head: Head | None) -> Store:
        """Opens the file, or a new one if the old one is damaged or gone. `head` is the newest entry
        that this server has written. LogError if it can't be opened."""
        try:
            return self._store(head)
        except LogCorrupt as error:
            name = set_aside(self._folder)
            log.error("the operator's log is damaged (%s): it is kept as %s", error, name)
            self._cause, self._new_file_reason = None, say("log_began_after_damage", name=name)
            return Store(self._folder, self._boot, head)

    def _store(self, head: Head | None) -> Store:
        lost = self._cause
        if isinstance(lost, LogCorrupt):
            raise lost
        taken = isinstance(lost, LogGone) and lost.is_main_file
        if not self._new_file_reason and (taken or (head and not (self._folder / NAME).exists())):
            self._new_file_reason = self._clear_and_explain(head)
        store = Store(self._folder, self._boot, head)
        self._cause = None
        return store

    def _clear_and_explain(self, head: Head | None) -> TextLike:
        with as_log_error():
            kept = make_room(self._folder)
        gone = say("log_began_after_removal", last=head.seq if head else 0)
        why = joined([gone, say("log_found_file_kept", name=kept) if kept else ""])
        log.error("%s", why)
        return why

    def first_entries(self, store: Store, head: Head | None) -> Sequence[Entry]:
        """The first entries to write: that the file is new, or that written entries are missing in it.

        `first` in the first entry of a file is that entry's own number: its chain may begin there.
        """
        newest = store.head
        if not newest.count and (self._new_file_reason or newest.seq or store.opened_before):
            why = self._new_file_reason or say("log_began_empty", last=newest.seq)
            return [new_entry("began", values={"first": newest.seq + 1}, reason=why)]
        if head is None or head.seq <= newest.seq:
            return []
        gone = say("log_entries_lost", first=newest.seq + 1, last=head.seq)
        log.error("%s", gone)
        return [new_entry("resumed", reason=gone)]

    def mark_written(self) -> None:
        """The first entries are written."""
        self._new_file_reason = ""


def unfinished_entries(store: Store) -> Sequence[Entry]:
    """Closing entries for presses of servers that ended before the result was known."""
    return [
        entry.follow_up(
            "corrected" if store.has_outcome(entry.seq) else "closed",
            "unknown",
            say("press_unknown_server_ended"),
        )
        for entry in store.undone()
    ]


def start_entries(
    store: Store, mode: str, record: StartRecord | None, key: str = ""
) -> Sequence[Entry]:
    """The entry of this start, and those about what has changed since the last one. `key` is the public
    key that signs the log, "" without one."""
    values: dict[str, Any] = {"mode": mode} | ({"key": key} if key else {})
    changed: Sequence[Entry] = ()
    if record is not None:
        try:
            about, changed = record.make(json.loads(store.last_start()).get("files", ""))
            values |= about
        except Exception:  # the panel starts all the same, and its log says that this is missing
            log.exception("the files of this start are not in the operator's log")
            values["kept"] = False
    return [new_entry("began", values=values, reason=say("log_began")), *changed]

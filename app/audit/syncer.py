"""The thread that syncs the operator's log to the disk."""

import threading
from collections.abc import Callable

from app.audit.store import Store
from app.audit.ticket import Results
from app.errors import LogError
from app.i18n import say


class Syncer:
    """Syncs committed entries; entries that arrive together share a sync."""

    def __init__(self, done: Callable[[Results], None], failed: Callable[[Results], None]) -> None:
        self._done = done
        self._failed = failed
        self._waiting: Results = []
        self._store: Store | None = None
        self._ended = False
        self._wake = threading.Condition()
        self._syncing = threading.Lock()
        self._thread = threading.Thread(target=self._run, name="operators-log-sync", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def set_store(self, store: Store | None) -> None:
        """Sets the file. Waits for a running sync first: the old file must stay open during it."""
        with self._syncing:
            self._store = store

    def add(self, written: Results) -> None:
        with self._wake:
            self._waiting += written
            self._wake.notify()

    def end(self, timeout_s: float) -> None:
        """Syncs the waiting entries, and ends the thread."""
        with self._wake:
            self._ended = True
            self._wake.notify()
        self._thread.join(timeout_s)

    def _run(self) -> None:
        while True:
            with self._wake:
                self._wake.wait_for(lambda: self._waiting or self._ended)
                batch, self._waiting = self._waiting, []
            if not batch:
                return
            try:
                with self._syncing:
                    if self._store is None:
                        raise LogError(say("log_file_reopening"))
                    self._store.sync()
            except LogError as error:
                self._failed([(ticket, error) for ticket, _ in batch])
            else:
                self._done(batch)

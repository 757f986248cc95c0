"""The entries about a start of the server: what it runs with, and what has changed since the last
start. The files are kept beside the log."""

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from app.audit.entry import Entry, new_entry
from app.audit.kept_files import KeptFiles, sha256
from app.audit.start_changes import changes, in_entries
from app.audit.start_files import PANEL, Manifest, StartFiles, parse_manifest
from app.errors import LogError
from app.i18n import say

log = logging.getLogger("kiosk.log")


@dataclass(frozen=True, slots=True)
class StartRecord:
    """`read` reads the files of this start. `revision` is the beginning of the hash of the panel file
    that was loaded. Used on the writer's thread."""

    kept: KeptFiles
    read: Callable[[], StartFiles]
    revision: str

    def make(self, last_files: str) -> tuple[dict[str, Any], Sequence[Entry]]:
        """Keeps the files; returns the values of the entry of the start, and the entries about what
        has changed. `last_files` is the hash of the manifest of the last start, "" if there is none."""
        start = self.read()
        manifest = start.manifest
        as_json = manifest.as_json()
        values: dict[str, Any] = {"version": manifest.version} | manifest.digests()
        values["files"] = sha256(as_json)
        if not values.get(PANEL, "").startswith(self.revision):
            values["panel_loaded"] = self.revision  # the file was changed in the meantime
        old, old_panel = self._last(last_files)
        try:
            not_kept = self.kept.keep({values["files"]: as_json} | dict(start.contents))
        except OSError as error:
            log.error("the files of this start are not kept beside the operator's log: %s", error)
            values["kept"] = False
        else:
            if not_kept:
                log.warning("%d files are too large to be kept beside the log", len(not_kept))
                values["kept"] = False
        if old is None:
            return values, ()
        new_panel = start.contents.get(values.get(PANEL, ""))
        changed = changes(old, manifest, old_panel, new_panel)
        values["changes"] = len(changed)
        reason = say("log_changed", count=len(changed))
        return values, [
            new_entry("changed", values=batch, reason=reason) for batch in in_entries(changed)
        ]

    def _last(self, last_files: str) -> tuple[Manifest | None, bytes | None]:
        """The manifest and the panel file of the last start, as far as they are kept."""
        if not last_files:
            return None, None
        try:
            manifest = parse_manifest(self.kept.read(last_files))
        except (LogError, OSError, ValueError) as error:
            log.warning("what has changed since the last start is not known: %s", error)
            return None, None
        try:
            return manifest, self.kept.read(next(iter(manifest.files.get(PANEL, {}).values()), ""))
        except (LogError, OSError):
            return manifest, None

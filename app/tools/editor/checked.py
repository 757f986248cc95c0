"""What `operator-panel check` says of the document that is edited."""

import hashlib
import time
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Final, NamedTuple

from app.panel import Panel
from app.panel.file.load import PanelChecker
from app.panel.file.toml_file import TomlFile
from app.system.errors import PanelError, Remark
from app.tools.editor.document import Document, EditError
from app.tools.editor.paths import Tables, path_at
from app.tools.editor.repairs import Repair, repair_of


class Checked(NamedTuple):
    """The panel, None with faults; faults and notes in the order of the file."""

    panel: Panel | None
    faults: Sequence[Remark] = ()
    notes: Sequence[Remark] = ()


NOT_CHECKED: Final = Checked(None)
REPAIRS_S: Final = 0.15  # for looking for repairs after an edit


class DocumentChecker:
    """Checks each version of one document; what did not change is not checked again."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._checker = PanelChecker()
        self._mended = PanelChecker()  # for repairs: its memory is of tables that no one has written

    def check(self, document: Document) -> Checked:
        if document.unreadable is not None:
            return Checked(None, (document.unreadable,))
        file = self._file(document)
        try:
            panel = self._checker.panel(file)
        except PanelError as error:
            return Checked(None, error.faults)
        return Checked(panel, (), self._checker.notes(panel, file))

    def repairs(self, document: Document, remarks: Sequence[Remark]) -> Iterator[Repair | None]:
        """The only repair of each remark; None where there is none. Those after `REPAIRS_S` are not
        looked for."""
        until, known = time.monotonic() + REPAIRS_S, {id(document.tables): tuple(remarks)}

        def check(tables: Tables) -> Sequence[Remark]:
            return known[id(tables)] if id(tables) in known else self._check_mended(document, tables)

        for remark in remarks:
            in_time = time.monotonic() < until
            yield repair_of(remark, document.tables, check) if in_time else None

    def _check_mended(self, document: Document, tables: Tables) -> Sequence[Remark]:
        file = TomlFile(self._path, document.text, dict(tables), "", lambda _: 0)
        try:
            panel = self._mended.panel(file)
        except PanelError as error:
            return error.faults
        return self._mended.notes(panel, file)

    def _file(self, document: Document) -> TomlFile:
        revision = hashlib.sha256(document.data).hexdigest()[:12]
        line_of = partial(_line_of, document)
        return TomlFile(self._path, document.text, dict(document.tables), revision, line_of)


def _line_of(document: Document, place: str) -> int:
    """The line of a place of the file, or of the innermost table around it that is written; 0 for
    none."""
    path = path_at(place)
    for end in range(len(path), 0, -1):
        try:
            return document.lines(path[:end])[0]
        except EditError:
            continue
    return 0

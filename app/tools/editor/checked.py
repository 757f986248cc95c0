"""What `operator-panel check` says of the document that is edited."""

import hashlib
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path as FilePath
from typing import Any, Final, NamedTuple

from app.panel import Panel
from app.panel.file.load import PanelChecker
from app.panel.file.toml_file import TomlFile
from app.panel.file.toml_lines import Path
from app.system.errors import PanelError, Remark
from app.tools.editor.document import Document, EditError
from app.tools.editor.paths import Tables, at, path_at
from app.tools.editor.repairs import Repair, repair_of


@dataclass(frozen=True)
class Checked:
    """The panel, None with faults; faults and notes in the order of the file. The notes are looked for
    when they are asked for: an edit is shown before."""

    panel: Panel | None
    faults: Sequence[Remark] = ()
    find_notes: Callable[[], Sequence[Remark]] = tuple

    @cached_property
    def notes(self) -> Sequence[Remark]:
        return self.find_notes()


class Drawable(NamedTuple):
    """A panel, and the tables that it was made of."""

    panel: Panel
    tables: Tables


NOT_CHECKED: Final = Checked(None)
MOST_ROUNDS: Final = 20  # of tables that are left out: what names them is faulty then
REPAIRS_S: Final = 0.15  # for looking for repairs after an edit


class DocumentChecker:
    """Checks each version of one document; what did not change is not checked again."""

    def __init__(self, path: FilePath) -> None:
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
        return Checked(panel, (), partial(self._checker.notes, panel, file))

    def drawable(self, document: Document) -> Drawable | None:
        """The panel of a faulty document without its faulty tables; None if nothing is left."""
        tables = deepcopy(dict(document.tables))
        for _ in range(MOST_ROUNDS):
            file = TomlFile(self._path, document.text, tables, "", lambda _: 0)
            try:
                return Drawable(self._mended.panel(file), tables)
            except PanelError as error:
                if not _remove_faulty(tables, error.faults):
                    return None
        return None

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


def _remove_faulty(tables: Any, faults: Sequence[Remark]) -> bool:
    """Removes the innermost listed table around each fault, else its key; whether there was any."""
    paths: set[Path] = set()
    for fault in faults:
        path = path_at(fault.place)
        ends = (end for end in range(len(path), 1, -1) if isinstance(path[end - 1], int))
        listed = (path[:end] for end in ends if isinstance(at(tables, path[:end]), Mapping))
        paths.add(next(listed, path[:1]))
    removed = False
    for path in sorted(paths, key=_order, reverse=True):  # those before stay where they are
        around = at(tables, path[:-1]) if path else None
        if path and at(tables, path) is not None and around is not None:
            del around[path[-1]]
            removed = True
    return removed


def _order(path: Path) -> list[tuple[int, str]]:
    """For sorting: numbers by their size."""
    return [(step, "") if isinstance(step, int) else (-1, step) for step in path]


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

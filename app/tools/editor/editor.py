"""What all browsers of one editor share: the document, what is wrong with it, and the preview."""

import asyncio
import os
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path as FilePath
from typing import Any

from app.panel.file.toml_lines import Path
from app.system.texts import TextLike, say
from app.tools.editor.checked import NOT_CHECKED, Checked, DocumentChecker
from app.tools.editor.document import Change, Document, Edit, EditError
from app.tools.editor.paths import tag_of
from app.tools.editor.preview import Preview
from app.tools.editor.repairs import Repair


class PanelFile:
    """The file on disk, as the document was opened from it or saved to it."""

    def __init__(self, path: FilePath) -> None:
        """OSError if it can't be read, UnicodeDecodeError if it is not text."""
        self.path = path
        self._data = path.read_bytes()
        self.document = Document(self._data.decode())

    @property
    def text(self) -> str:
        return self._data.decode()

    @property
    def is_saved(self) -> bool:
        return self.document.data == self._data

    def save(self) -> None:
        """Replaces the file; EditError if it is another one than was opened, or can't be written."""
        data = self.document.data
        beside = self.path.with_name(f".{self.path.name}.{os.getpid()}")
        try:
            if self.path.read_bytes() != self._data:
                raise EditError(say("editor_changed_on_disk", file=self.path.name))
            with beside.open("wb") as new:
                new.write(data)
                new.flush()
                os.fsync(new.fileno())
            shutil.copymode(self.path, beside)
            beside.replace(self.path)
        except OSError as error:
            beside.unlink(missing_ok=True)
            raise EditError(say("editor_not_saved", why=error.strerror or str(error))) from error
        self._data = data


@dataclass(eq=False)
class Browser:
    """A browser with the editor's page; `selection` is the path that it has selected."""

    number: int
    selection: Path | None = None
    changed: asyncio.Event = field(default_factory=asyncio.Event)


class Editor:
    """What all browsers of one editor share. Used on the event loop only."""

    def __init__(
        self, file: PanelFile, preview: Preview, checker: DocumentChecker, language: str = ""
    ) -> None:
        """`language` is that of the editor's pages; "" for that of each browser."""
        self.file = file
        self.changes = 0  # since it was saved
        self.preview = preview
        self.language = language
        self.checked: Checked = NOT_CHECKED
        self.browsers: dict[str, Browser] = {}
        self._checker = checker
        self._numbers = 0
        preview.on_live = self.notify

    @property
    def document(self) -> Document:
        return self.file.document

    def apply(self, edits: Iterable[Edit], label: str) -> Change:
        """One step; EditError if an edit can't be made."""
        return self._changed(self.document.apply(edits, label), 1)

    def undo(self) -> Change:
        """EditError if nothing was done."""
        return self._changed(self.document.undo(), -1)

    def redo(self) -> Change:
        """EditError if nothing was taken back."""
        return self._changed(self.document.redo(), 1)

    def save(self) -> None:
        """EditError if the file on disk is another one by now, or can't be written."""
        self.file.save()
        self.changes = 0
        self.notify()

    def _changed(self, change: Change, number: int) -> Change:
        self.changes += number
        self.show()
        return change

    def show(self) -> None:
        """Checks the document, and shows its panel if it has no fault."""
        document = self.document
        self.checked = self._checker.check(document)
        if self.checked.panel is not None:
            self.preview.show(self.checked.panel, document.tables)
        self.notify()

    def repairs(self) -> Iterator[Repair | None]:
        """The only repair of each fault, of each note if there is no fault; None for those without."""
        checked = self.checked
        return self._checker.repairs(self.document, checked.faults or checked.notes)

    def notify(self) -> None:
        """Tells all browsers."""
        for browser in self.browsers.values():
            browser.changed.set()

    def browser(self, name: str) -> Browser:
        known = self.browsers.get(name)
        if known is None:
            self._numbers += 1
            known = self.browsers[name] = Browser(self._numbers)
        return known

    def state(self, name: str) -> dict[str, Any]:
        """What a browser shows outside its panes."""
        is_saved, document, changes = self.file.is_saved, self.document, abs(self.changes)
        status: TextLike = say("editor_saved")
        if not is_saved:
            status = say("editor_change" if changes == 1 else "editor_changes", number=changes)
        return {
            "revision": document.revision,
            "drawn": self.preview.number,
            "live": self.preview.live_number,
            "saved": is_saved,
            "status": status,
            "undo": document.undo_label is not None,
            "redo": document.redo_label is not None,
            "faults": len(self.checked.faults),
            "others": [
                {
                    "number": other.number,
                    "path": other.selection,
                    "tag": tag_of(document.tables, other.selection),
                }
                for key, other in self.browsers.items()
                if key != name and other.selection is not None
            ],
        }


@dataclass(frozen=True, slots=True)
class PartRequest:
    """What a fragment is rendered from."""

    editor: Editor
    path: Path
    language: str
    query: Mapping[str, str]


# Name of a pane → (template, context) of its fragment.
Part = Callable[[PartRequest], tuple[str, Mapping[str, Any]]]

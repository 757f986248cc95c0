"""What all browsers of one editor share: the document, what is wrong with it, and the preview."""

import asyncio
import contextlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from app.panel.file.toml_lines import Path
from app.system.texts import TextLike, say
from app.tools.editor.checked import NOT_CHECKED, Checked, DocumentChecker
from app.tools.editor.document import Change, Document, Edit, ReplaceText
from app.tools.editor.merge import Side
from app.tools.editor.paths import tag_of
from app.tools.editor.preview import Preview
from app.tools.editor.repairs import Repair
from app.tools.editor.robot_list import RobotList
from app.tools.editor.sending import Sending
from app.tools.editor.session import EditSession, SaveConflict, Saved
from app.tools.editor.starting import empty_text
from app.tools.scaffold.parts import label_of

WATCH_S: Final = 1.0


@dataclass(eq=False)
class Browser:
    """A browser with the editor's page; `selection` is the path that it has selected."""

    number: int
    selection: Path | None = None
    person: str = ""  # who is signed in there
    changed: asyncio.Event = field(default_factory=asyncio.Event)


class Editor:
    """What all browsers of one editor share. Used on the event loop only."""

    def __init__(
        self, session: EditSession, preview: Preview, checker: DocumentChecker, language: str = ""
    ) -> None:
        """`language` is that of the editor's pages; "" for that of each browser."""
        self.session = session
        self.changes = 0  # since it was saved
        self.preview = preview
        self.robots = RobotList(preview.robot_place)
        self.language = language
        self.checked: Checked = NOT_CHECKED
        self._is_whole = False  # whether the preview has shown a panel without faults
        self.browsers: dict[str, Browser] = {}
        self._checker = checker
        self._numbers = 0
        self._begun = ""  # the text of a new file
        self._is_gone = False  # whether the file was removed
        self._sendings: dict[str, Sending] = {}  # by who sends
        self._sending_steps = 0
        self.on_save: Callable[[str, Saved], None] = lambda author, saved: None
        preview.on_live = self.notify

    @property
    def document(self) -> Document:
        return self.session.document

    @property
    def is_new(self) -> bool:
        """Whether the file has nothing yet but the empty page with which it was begun."""
        return not self.session.base_text.strip() and self.document.text in ("", self._begun)

    def begin(self) -> None:
        """Shows the file. An empty one is begun with a page, as a change that is not saved."""
        session = self.session
        text = self._begun = empty_text(label_of(session.path.stem))
        if session.recovered is not None and session.recovered.text == text:
            session.drop_recovered()
        if session.recovered is not None or self.document.text.strip():
            self.show()
        else:
            self.apply([ReplaceText((), text)], "")

    def apply(
        self, edits: Iterable[Edit], label: str, revision: int | None = None, author: str = ""
    ) -> Change:
        """One step; EditError if an edit can't be made, EditBehind if it is of an older revision and
        its table has changed since."""
        return self._changed(self.session.apply(edits, label, revision=revision, author=author), 1)

    def undo(self, author: str = "") -> Change:
        """EditError if nothing was done."""
        return self._changed(self.session.undo(author), -1)

    def redo(self, author: str = "") -> Change:
        """EditError if nothing was taken back."""
        return self._changed(self.session.redo(author), 1)

    def save(self, author: str = "", *, recreate: bool = False) -> TextLike:
        """Saves, with the changes that others have made in the file, and returns what went wrong
        beside that. `recreate`: also if the file was removed. SaveConflict if both have changed a
        table, SessionError if it can't be written."""
        revision = self.document.revision
        try:
            saved = self.session.save(recreate=recreate, author=author)
        finally:
            self.notify()
        self.on_save(author, saved)
        self.changes, self._is_gone = 0, False
        if self.document.revision != revision:
            self.show()
        return saved.problem

    def resolve(self, name: str, choice: Side | tuple[str]) -> None:
        """Chooses a side of a conflict with the file on the disk, or another text in a tuple."""
        self.session.resolve(name, choice)
        self.notify()

    def take_recovered(self, author: str = "") -> Change:
        """Goes on with what was not saved when the editor ended."""
        return self._changed(self.session.take_recovered(author), 1)

    def drop_recovered(self) -> None:
        self.session.drop_recovered()
        self.notify()

    async def watch(self) -> None:
        """Takes what others write into the file, for ever; what both have changed waits for Save."""
        while True:
            await asyncio.sleep(WATCH_S)
            was_gone, self._is_gone = self._is_gone, self.session.disk_state == "gone"
            if was_gone != self._is_gone:
                self.notify()
            session = self.session
            if not (
                session.has_old_conflicts if session.conflicts else session.disk_state == "changed"
            ):
                continue
            revision = self.document.revision
            with contextlib.suppress(SaveConflict):
                self.session.merge_from_disk()
            if self.document.revision != revision:
                self.show()
            else:
                self.notify()

    def _changed(self, change: Change, number: int) -> Change:
        self.changes += number
        self.show()
        return change

    def show(self) -> None:
        """Checks the document, and shows its panel if it has no fault. A file that has had faults ever
        since it was opened is shown without the faulty tables."""
        document = self.document
        self.checked = self._checker.check(document)
        if self.checked.panel is not None:
            self.preview.show(self.checked.panel, document.tables)
            self._is_whole = True
        elif not self._is_whole and (drawable := self._checker.drawable(document)):
            self.preview.show(drawable.panel, drawable.tables)
        self.notify()

    def repairs(self) -> Iterator[Repair | None]:
        """The only repair of each fault, of each note if there is no fault; None for those without."""
        checked = self.checked
        return self._checker.repairs(self.document, checked.faults or checked.notes)

    def sending(self, person: str) -> Sending:
        """What a person sends to a kiosk, with their token."""
        known = self._sendings.get(person)
        if known is None:
            known = self._sendings[person] = Sending(self.session.path, self._sending_changed)
        return known

    def _sending_changed(self) -> None:
        self._sending_steps += 1
        self.notify()

    def close(self) -> None:
        for sending in self._sendings.values():
            sending.close()

    def notify(self) -> None:
        """Tells all browsers."""
        for browser in self.browsers.values():
            browser.changed.set()

    def browser(self, name: str, person: str = "") -> Browser:
        known = self.browsers.get(name)
        if known is None:
            self._numbers += 1
            known = self.browsers[name] = Browser(self._numbers, person=person)
        return known

    def state(self, name: str) -> dict[str, Any]:
        """What a browser shows outside its panes."""
        session, document, changes = self.session, self.document, max(1, abs(self.changes))
        is_saved = not session.unsaved
        status: TextLike = say("editor_saved")
        if not is_saved:
            status = say("editor_change" if changes == 1 else "editor_changes", number=changes)
        return {
            "revision": document.revision,
            "drawn": self.preview.number,
            "live": self.preview.live_number,
            "saved": is_saved,
            "new": self.is_new,
            "status": status,
            "undo": document.undo_label is not None,
            "redo": document.redo_label is not None,
            "faults": len(self.checked.faults),
            "conflicts": len(session.conflicts),
            "gone": self._is_gone,
            "recovered": session.recovered is not None,
            "warning": session.journal_problem,
            "sending": self._sending_steps,
            "others": [
                {
                    "number": other.number,
                    "person": other.person,
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
    person: str = ""  # who is signed in


# Name of a pane → (template, context) of its fragment.
Part = Callable[[PartRequest], tuple[str, Mapping[str, Any]]]

"""What a panel file, and a further page of one, is started from: nothing, the robot that is there, a
shipped example, or a page of another file."""

import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path as FilePath
from typing import Any, Final, Literal, NamedTuple

from pydantic import BaseModel

from app.system.errors import NotFound
from app.system.settings import PACKAGE, SHIPPED_PANELS, shipped_path
from app.system.texts import TextLike, render, say
from app.tools.editor.document import Change, Document, Edit, EditError, Insert, ReplaceText, SetValue
from app.tools.editor.editor import Editor, PartRequest
from app.tools.editor.paths import Tables
from app.tools.editor.starting import empty_text, page_edits
from app.tools.robot.link import Place
from app.tools.robot.scaffold import scaffold
from app.tools.scaffold.parts import label_of

MOST_FILES: Final = 50
LARGEST: Final = 2_000_000  # bytes of another panel file
INTERFACES: Final = "interfaces"


class Start(BaseModel):
    """What to start from: `file` is the name of another one; `page` the id of its page."""

    revision: int
    source: Literal["empty", "robot", "file", "page"]
    file: str = ""
    page: str = ""


class Offer(NamedTuple):
    """`start` is what is posted for it."""

    start: Mapping[str, str]
    title: TextLike
    about: TextLike = ""


class OfferedFile(NamedTuple):
    """Another panel file; `offers` are its pages."""

    name: str
    title: str
    offers: Sequence[Offer]


def start_pane(request: PartRequest) -> tuple[str, Mapping[str, Any]]:
    """The offers for the whole file while it is new; else those for a further page."""
    editor = request.editor
    is_new = editor.is_new
    first = Offer({"source": "empty"}, say("editor_empty_page"))
    if is_new:
        first = Offer({"source": "robot"}, say("editor_start_robot"), say("editor_start_reads"))
    offers = [first]
    shipped = _shipped()
    files = []
    for name, path in _others(editor).items():
        tables = _document(path).tables
        if is_new and name in shipped:
            title = say("editor_start_example", title=_text(tables, request.language))
            offers.append(Offer({"source": "file", "file": name}, title))
        pages = [
            Offer(
                {"source": "page", "file": name, "page": str(page.get("id", ""))},
                _text(page, request.language),
            )
            for page in tables["page"]
            if isinstance(page, dict)
        ]
        files.append(OfferedFile(name, _text(tables, request.language), pages))
    return "_start.html", {
        "title": say("editor_start") if is_new else say("editor_start_page"),
        "offers": offers,
        "files": files,
        "of_another": say("editor_page_of_another"),
    }


async def started(editor: Editor, start: Start, robot: Place, author: str = "") -> tuple[Change, str]:
    """What was asked for, as one step, and the id of the page that is new. KioskError, such as that
    there is no robot."""
    edits: list[Edit]
    if start.source in ("file", "robot") and not editor.is_new:
        raise EditError(say("editor_not_empty"))
    if start.source == "robot":
        made = await scaffold(robot, editor.session.path.parent)
        edits = [ReplaceText((), made.text)]
    elif start.source == "empty":
        edits = [_empty_page(editor.document.tables)]
    else:
        edits = _from_file(editor, start)
    before = [] if editor.is_new else _page_ids(editor.document.tables)
    change = editor.apply(edits, start.source, start.revision, author)
    new = [name for name in _page_ids(editor.document.tables) if name not in before]
    return change, new[-1] if new else ""


def _from_file(editor: Editor, start: Start) -> list[Edit]:
    """The edits that bring another file, or a page of it, with the types that it needs."""
    file = _others(editor).get(start.file)
    if file is None:
        raise NotFound(say("editor_file_gone", name=start.file[:64]))
    other, target, folder = _document(file), editor.document, editor.session.path.parent
    edits: list[Edit] = []
    if start.source == "file":
        edits.append(ReplaceText((), other.text))
        target = other
        have: list[Any] = []
    else:
        if editor.is_new:
            target = Document(empty_text(label_of(editor.session.path.stem)).partition("\n[[page]]")[0])
            edits.append(ReplaceText((), target.text))
        ids = _page_ids(other.tables)
        if start.page not in ids:
            raise NotFound(say("editor_file_gone", name=start.page[:64]))
        edits += page_edits(target, other, ("page", ids.index(start.page)))
        have = [*_list(target.tables, INTERFACES)]
    needed = [os.path.relpath(file.parent / name, folder) for name in _list(other.tables, INTERFACES)]
    if new := [name for name in needed if name not in have]:
        edits.append(SetValue((INTERFACES,), [*have, *new]))
    return edits


def _empty_page(tables: Tables) -> Edit:
    """A page at the end, with the first id that is free."""
    ids = _page_ids(tables)
    number = next(n for n in range(len(ids) + 1, 2 * len(ids) + 3) if f"page_{n}" not in ids)
    language = tables.get("language", "en")
    title = render(say("editor_add_page"), language if isinstance(language, str) else "en")
    return Insert(("page", len(ids)), {"id": f"page_{number}", "title": f"{title} {number}"})


def _list(tables: Tables, key: str) -> Iterator[Any]:
    value = tables.get(key)
    yield from value if isinstance(value, list) else ()


def _page_ids(tables: Tables) -> list[Any]:
    return [page.get("id") if isinstance(page, dict) else None for page in _list(tables, "page")]


def _text(table: Mapping[str, Any], language: str) -> str:
    """The title of a panel or a page."""
    title = table.get("title", "")
    if isinstance(title, dict):
        title = title.get(language) or next(iter(title.values()), "")
    return title if isinstance(title, str) else ""


def _shipped() -> dict[str, FilePath]:
    files = {"palletizer": PACKAGE / "panel.toml"}
    return files | {name: shipped_path(file) for name, file in SHIPPED_PANELS.items()}


def _others(editor: Editor) -> Mapping[str, FilePath]:
    """The panel files beside the one that is edited, then the shipped ones, by their names."""
    own = editor.session.path
    named = {name: path for name, path in panels_in(own.parent).items() if name != own.name}
    return named | {name: path for name, path in _shipped().items() if _is_panel(path)}


def panels_in(folder: FilePath) -> Mapping[str, FilePath]:
    """The panel files of a folder by their names."""
    files = sorted(folder.glob("*.toml"))[:MOST_FILES]
    return {path.name: path for path in files if _is_panel(path)}


def _is_panel(path: FilePath) -> bool:
    try:
        return path.stat().st_size <= LARGEST and any(_list(_document(path).tables, "page"))
    except (OSError, UnicodeDecodeError):
        return False


def _document(path: FilePath) -> Document:
    return Document(path.read_text(encoding="utf-8-sig"))

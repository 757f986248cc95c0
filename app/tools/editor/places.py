"""Where the tables of a panel file are on a page, by CSS selectors of the page's markup."""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

from app.panel import Panel
from app.panel.file.toml_lines import Path
from app.panel.layout import COLUMNS, Page
from app.tools.editor.paths import EMPTY, Tables, at, tag_of, widget_paths


class GridSize(NamedTuple):
    """Columns and rows that a widget or group takes, of at most `columns`."""

    span: int
    rows: int
    columns: int


class Place(NamedTuple):
    """A part of a page: `path` is its table's, `tag` what it is called. Parts inside come later. With
    `beside` it is empty: the room that these parts leave in the element, where a new table comes."""

    path: Path
    selector: str
    tag: str
    size: GridSize | None = None
    beside: tuple[str, ...] | None = None

    def as_json(self) -> dict[str, Any]:
        return self._asdict() | {"size": self.size._asdict() if self.size else None}


def places_on(page: Page, panel: Panel, tables: Tables) -> Iterator[Place]:
    """The parts of a page that can be selected. The panel may be older than the tables."""
    by_id = {str(widget.get("id", "")): path for path, widget in widget_paths(tables)}

    def place(path: Path, selector: str) -> Place:
        return Place(path, selector, tag_of(tables, path))

    yield place((), "body > header")
    if panel.state:
        yield place(("state",), "header .states")
    if panel.may_raise:
        yield place(("alarms",), "body > .alarm-line")
    for widget in panel.frame.widgets:
        if (path := by_id.get(str(widget.id))) is not None:
            yield place(path, f'.frame-keys [data-widget="{widget.id}"]')
    for number, other in enumerate(panel.pages):
        path = _page_path(tables, other.id, number)
        yield place(path, f'nav.pages a[href*="/pages/{other.id}"]')
        if other is page:
            yield place(path, "main")
            yield from _on_page(page, path, by_id, tables)


def _on_page(page: Page, path: Path, by_id: dict[str, Path], tables: Tables) -> Iterator[Place]:
    shift = 1 if page.own else 0
    inside: dict[Path, list[str]] = {(*path, "group", number): [] for number in range(len(page.groups))}
    groups = [f'.group[data-group="{number}"]' for number in range(len(page.parts))]
    yield _empty((*path, "group" if groups else "widget", len(page.groups)), "main", groups)
    for number, group in enumerate(page.groups):
        own = (*path, "group", number)
        size = GridSize(group.span, 1, COLUMNS)
        yield Place(own, groups[number + shift], tag_of(tables, own), size)
    for place, widget in page.placed():
        steps = _steps(place)
        own = by_id.get(str(widget.id), ())
        if own[:2] != path:  # a copy of a widget of another page
            own = (*path, *steps)
        around = page.groups[int(steps[1])] if steps[0] == "group" else page.parts[0]
        size = GridSize(around.span_of(widget), widget.rows, around.grid)
        selector = f'[id="at-{widget.id}"]'
        inside.setdefault(own[:-2], []).append(selector)
        yield Place(own, selector, tag_of(tables, own), size)
    for outer, selectors in inside.items():
        part = int(outer[-1]) + shift if outer[-2] == "group" else 0
        yield _empty((*outer, "widget", len(selectors)), groups[part], selectors)


def _empty(path: Path, selector: str, beside: Sequence[str]) -> Place:
    return Place((*path, EMPTY), selector, "", None, tuple(beside))


def _steps(place: str) -> Path:
    """`group[0].widget[2]` → its steps."""
    steps: list[str | int] = []
    for part in place.split("."):
        name, _, number = part.rstrip("]").partition("[")
        steps += [name, int(number)]
    return tuple(steps)


def _page_path(tables: Tables, page_id: str, number: int) -> Path:
    pages = at(tables, ("page",))
    if isinstance(pages, list):
        for own, page in enumerate(pages):
            if isinstance(page, dict) and page.get("id") == page_id:
                return ("page", own)
    return ("page", number)


def page_of(path: Path, tables: Tables) -> str:
    """The id of the page around a path; "" for none."""
    page = at(tables, path[:2]) if path[:1] == ("page",) else None
    return str(page.get("id", "")) if isinstance(page, dict) else ""

"""Which texts of a panel are cut, on which screens and in which languages."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from itertools import chain
from typing import Final, NamedTuple

from app.panel.checks.fit import GAP, cell_width, group_width, page_width, row_heights
from app.panel.checks.memory import NO_MEMORY, CheckMemory
from app.panel.layout import COLUMNS, Group, Page, is_button
from app.panel.model import Panel
from app.panel.widgets.displays import Conditions
from app.panel.widgets.families import Command, KeyCommand
from app.panel.widgets.tiles import (
    ENTRY_MM,
    GAP_MM,
    KEY_MM,
    LOW_SCREEN,
    MIDDLE,
    NARROW,
    Screen,
)
from app.panel.widths.boxes import SIZES, Box, Cell, Cut
from app.panel.widths.fonts import font_notes, fonts_of
from app.panel.widths.texts import (
    MANY,
    condition_texts,
    face_texts,
    reason_texts,
    stop_hint_text,
    texts,
)
from app.system.errors import Note

KIOSK_SCREENS: Final = ("1280x800", "1024x600", "800x480")  # where the panel file names none
MAX_KEY_MM: Final = 28.0  # on a page that fits
TAB_PAD: Final = 9.0  # of a page's tab, with the border of the rail
HEAD_GAP: Final = 12.0
GROUP_TAB_PAD: Final = 8.0
ROBOT_MM: Final = 20.0  # of a robot's tab, at least
ROBOT_GAP: Final = 8.0
ROBOT_PAD: Final = 14.0  # with the borders
FRAME_KEY_PAD: Final = 15.0  # of the rail and of a button's face
FRAME_FACE_PADS: Final = 2.0  # less above and below than on other buttons
Placed = Iterator[tuple[str, Box]]


class Finding(NamedTuple):
    """A text that is cut on one screen."""

    place: str
    box: Box
    language: str
    cut: Cut
    size: str


def cut_notes(panel: Panel, memory: CheckMemory = NO_MEMORY) -> Iterator[Note]:
    """A note for each text that is cut on a screen of the panel, and for each font whose letters
    have no known widths."""
    yield from font_notes(panel)
    needs: dict[tuple[str, str, str], dict[tuple[str, str], list[str]]] = {}
    for finding in findings(panel, memory):
        cut, box, key = finding.cut, finding.box, (finding.place, finding.cut.text, finding.language)
        name = f"locked {box.name}" if box.locked and cut.needs.endswith("lines") else box.name
        widths = cut.needs, f"the {name} has {cut.has}"
        needs.setdefault(key, {}).setdefault(widths, []).append(finding.size)
    notes: dict[tuple[str, str, str], list[str]] = {}
    for (place, text, language), widths_by_size in needs.items():
        notes.setdefault((place, text, _said(widths_by_size)), []).append(language)
    for (place, text, said), languages in notes.items():
        tags = f" ({', '.join(languages)})" if len(panel.readers_languages) > 1 else ""
        yield Note(place, f'"{text}"{tags} {said}')


def _said(widths: Mapping[tuple[str, str], Iterable[str]]) -> str:
    """What a text needs and has on each screen: "needs 96 px, the button has 80 at 800x480"."""
    parts = (
        f"needs {need}, {has} at {' and '.join(dict.fromkeys(sizes))}"
        for (need, has), sizes in widths.items()
    )
    return "; ".join(parts)


def findings(panel: Panel, memory: CheckMemory = NO_MEMORY) -> Iterator[Finding]:
    """Every text that is cut, for each screen and language."""
    for size in panel.screens or KIOSK_SCREENS:
        screen = Screen.from_size(size, panel.mm_per_px)
        if screen.width < NARROW:
            continue  # a phone's pages scroll
        yield from _cut(panel, size, chain(_robot_tabs(panel, screen), _rail(panel, screen)))
        for p, page in enumerate(panel.pages):
            depends = screen, _around(panel, page)
            findings_on_page = partial(_cut_on_page, panel, page, size, screen)
            kept = memory.results(f"texts at {size}", p, page, depends, findings_on_page)
            for finding in kept:
                yield finding._replace(place=f"page[{p}]{finding.place}")


def _cut(panel: Panel, size: str, placed: Iterable[tuple[str, Box]]) -> Iterator[Finding]:
    """The texts that are cut, in each language."""
    fonts = fonts_of(panel)
    for place, box in placed:
        for language in panel.readers_languages:
            if cut := box.cut(language, fonts):
                yield Finding(f"{place}.{box.part}", box, language, cut, size)


def _cut_on_page(panel: Panel, page: Page, size: str, screen: Screen) -> Iterator[Finding]:
    """The same, with places below the page's."""
    yield from _cut(panel, size, _page(panel, page, screen))


def _around(panel: Panel, page: Page) -> tuple[object, ...]:
    """What decides beside a page which of its texts are cut."""
    commands = [widget for widget in page.widgets if isinstance(widget, Command)]
    used = {name for widget in commands for name in widget.interlocks}
    shows = any(isinstance(widget, Conditions) for widget in page.widgets)
    return (
        [interlock for interlock in panel.interlocks if interlock.id in used],
        panel.named_conditions if shows else (),
        panel.readers_languages,
        panel.text_size,
        panel.stop_hint,
        panel.has_rail,
        fonts_of(panel),
    )


def boxes(panel: Panel, screen: Screen) -> Placed:
    """(place in the panel file, place of a text) of every text on a screen; a phone's pages scroll."""
    if screen.width < NARROW:
        return
    yield from _robot_tabs(panel, screen)
    yield from _rail(panel, screen)
    for p, page in enumerate(panel.pages):
        yield from ((f"page[{p}]{place}", box) for place, box in _page(panel, page, screen))


def _robot_tabs(panel: Panel, screen: Screen) -> Placed:
    """The name of each robot on its tab; the word of its link is below."""
    room, least = screen.width - 2 * screen.pad + ROBOT_GAP, ROBOT_MM * screen.mm + ROBOT_GAP
    columns = max(1, min(len(panel.robots), int(room / least)))
    width, size = room / columns - ROBOT_GAP - ROBOT_PAD, SIZES[panel.text_size].small
    for number, robot in enumerate(panel.robots):
        yield f"robot[{number}]", Box("name", robot.name, width, size, bold=True, name="tab")


def _rail(panel: Panel, screen: Screen) -> Placed:
    sizes = SIZES[panel.text_size]
    for p, page in enumerate(panel.pages if len(panel.pages) > 1 else ()):
        width = screen.rail - TAB_PAD
        title = Box(
            "title", page.title, width, sizes.small, bold=True, lines=MANY, wraps=True, name="tab"
        )
        yield f"page[{p}]", title
    interlocks = {interlock.id: interlock for interlock in panel.interlocks}
    stops = {widget.id for widget in panel.stops}
    for w, widget in enumerate(panel.frame.widgets):
        if not isinstance(widget, KeyCommand):
            continue
        is_low = screen.height <= LOW_SCREEN and widget.id not in stops
        height = screen.touch(ENTRY_MM if is_low else KEY_MM) + FRAME_FACE_PADS
        cell = Cell(screen.rail, height, screen, sizes, fit=True, fonts=fonts_of(panel))
        inside = screen.rail - FRAME_KEY_PAD
        for box in face_texts(widget, inside, cell, sizes.text):
            yield f"frame.widget[{w}]", box
        for box in reason_texts(widget, interlocks, cell, inside=inside):
            yield f"frame.widget[{w}]", box
        for box in stop_hint_text(widget, panel.stop_hint, cell, inside):
            yield f"frame.widget[{w}]", box


def _page(panel: Panel, page: Page, screen: Screen) -> Placed:
    """Those of a page, with places below its own; one with a template places them itself."""
    if page.template:
        return
    interlocks = {interlock.id: interlock for interlock in panel.interlocks}
    conditions = {entry.id: entry for entry in panel.named_conditions}
    own = 1 if page.own else 0
    for number, group in enumerate(page.parts):
        at = "" if number < own else f".group[{number - own}]"
        width = _group_width(group, page, screen, page_width(panel, screen))
        for box in _headings(panel, page, number, screen, width):
            yield at, box
        for w, cell in enumerate(_cells(panel, page, group, screen, width)):
            widget = group.widgets[w]
            reasons = [
                *stop_hint_text(widget, panel.stop_hint, cell),
                *reason_texts(widget, interlocks, cell),
            ]
            for box in (*texts(widget, cell), *reasons, *condition_texts(widget, conditions, cell)):
                yield f"{at}.widget[{w}]", box


def _group_width(group: Group, page: Page, screen: Screen, width: float) -> float:
    """The width inside a group."""
    if page.fit:
        return group_width(group, page, screen, width)
    span = group.span if screen.width >= MIDDLE else COLUMNS
    return (width + GAP) * span / COLUMNS - GAP - 2 * screen.pad


def _cells(panel: Panel, page: Page, group: Group, screen: Screen, width: float) -> Iterator[Cell]:
    """The cells of a group's widgets, in their order."""
    gap = GAP_MM * screen.mm
    heights = row_heights(group, screen, width)
    for widget, row, rows in group.cells():
        height = sum(heights[row : row + rows]) + GAP * (rows - 1)
        if is_button(widget):
            height -= gap - GAP
            height = min(height, MAX_KEY_MM * screen.mm) if page.fit else height
        own_width, sizes = cell_width(group, widget, screen, width), SIZES[panel.text_size]
        yield Cell(own_width, height, screen, sizes, page.fit, fonts_of(panel))


def _headings(panel: Panel, page: Page, number: int, screen: Screen, width: float) -> Iterator[Box]:
    """The title of a group, as its heading or as a tab, and the note beside it."""
    sizes, group = SIZES[panel.text_size], page.parts[number]
    title = group.title or page.title
    if tab := _tab_width(panel, page, number, screen):
        inside = tab - GROUP_TAB_PAD
        yield Box("title", title, inside, sizes.text, bold=True, lines=2, wraps=True, name="tab")
    elif group.title:
        heading = Box("title", title, width, sizes.text, bold=True, name="heading")
        if group.note:
            left = width - HEAD_GAP
            heading = replace(heading, width=left, beside=group.note, beside_size=sizes.small)
        yield heading


def _tab_width(panel: Panel, page: Page, number: int, screen: Screen) -> float:
    """The width of the tab of a group that takes turns with others; 0 for one that does not."""
    count = len(page.parts)
    if not page.fit or screen.is_wide or count == 1:
        return 0.0
    width = page_width(panel, screen)
    if screen.width < MIDDLE and not screen.is_upright:
        return (width - 4 * (count - 1)) / count
    if count == 2 or number == 0:
        return 0.0
    half = (width - GAP) / 2 if screen.width >= MIDDLE else width
    return (half - 4 * (count - 2)) / (count - 1)

"""The page of a wall: what is drawn of its cells, and the parts that its events bring."""

import time
from collections.abc import Iterator, Mapping, Sequence
from datetime import datetime
from typing import Any, Final, NamedTuple, TypedDict
from urllib.parse import urlencode

from app.cell.alarms.shown import PRIORITY_WORDS, STATE_WORDS
from app.cell.site.cells import TILE_KINDS, CellAlarm, CellFilter, Shown, TileKind, WallCell
from app.cell.site.summary import Words, said_in
from app.cell.site.wall import Wall
from app.system.clock import format_age, format_time
from app.system.limits import BoundedDict
from app.system.printable import one_line
from app.system.texts import Text, TextLike, joined, number, render, say
from app.web.pages.page_templates import PageTemplates

MAX_WORD: Final = 40  # characters of a word or figure on a tile
MAX_ALARM: Final = 120
MAX_IN_VIEW: Final = 400  # tiles that are sent to one page
MARGIN: Final = 24  # tiles before and after those that are seen
KEPT_TILES: Final = 8_000  # rendered, of all languages
COUNT_WORDS: Final[Mapping[TileKind, Text]] = {
    "running": say("wall_running"),
    "waiting": say("wall_waiting"),
    "manual": say("wall_manual"),
    "fault": say("wall_fault"),
    "unknown": say("wall_unknown"),
    "lost": say("wall_lost"),
}
FILTERS: Final[Mapping[Shown, Text]] = {
    "all": say("wall_all"),
    "abnormal": say("wall_abnormal"),
    "alarms": say("wall_with_alarm"),
}


# The words of the page, by their names in its template.
WORDS: Final[Mapping[str, Text]] = {
    "title": say("wall_title"),
    "view_only": say("wall_view_only"),
    "nothing_acts": say("wall_nothing_acts"),
    "alarms": say("wall_alarms"),
    "only_cell": say("wall_only_cell"),
    "no_alarm": say("wall_no_alarm"),
    "unacknowledged": say("wall_unacknowledged"),
    "sums": say("wall_sums"),
    "filter": say("wall_filter"),
    "sites": say("wall_sites"),
    "places": say("wall_places"),
    "find": say("wall_find"),
    "find_go": say("wall_find_go"),
    "none": say("wall_none"),
    "none_found": say("wall_none_found"),
}


class WallState(NamedTuple):
    """The wall in a word: `kind` is "fault", "cut" without a router, else ""."""

    kind: str
    word: TextLike
    detail: TextLike


def state_of_wall(wall: Wall) -> WallState:
    counts = wall.table.counts()
    every = number(str(counts.total()))
    if not wall.is_connected:
        return WallState("cut", say("wall_no_router_short"), "")
    if counts["fault"]:
        part = number(str(counts["fault"]))
        return WallState("fault", say("wall_of_cells", count=part, all=every), say("wall_in_fault"))
    return WallState("", say("wall_cells", count=every), "")


def header_of(wall: Wall) -> Mapping[str, Any]:
    """What the frame of every page of a wall shows: its state, and in the place of Stop where that
    is."""
    return {
        "state": state_of_wall(wall),
        "view_only": say("wall_view_only"),
        "stop_at_cell": say("wall_stop_at_cell"),
    }


class Tile(TypedDict):
    """What a tile shows; `is_dimmed`: the filter leaves it out. `number` and `unit` are its figure."""

    id: str
    name: str
    kind: TileKind
    word: TextLike
    title: TextLike
    age: TextLike
    number: str
    unit: str
    is_live: bool
    priority: int
    url: str
    mark: TextLike
    is_dimmed: bool


class AlarmLine(NamedTuple):
    """An alarm in the list of all cells; `age_id` is the name of its age among those of the page."""

    age_id: str
    cell: str
    text: str
    priority: int
    priority_text: TextLike
    state: TextLike
    at: TextLike
    age: TextLike
    url: str
    control: TextLike

    @property
    def sentence(self) -> Text:
        return say("wall_cell_alarm", cell=self.cell, text=self.text)


def line_of_words(words: Words, language: str, most: int) -> str:
    """A text of a cell: one line, without characters that hide or move others."""
    return one_line(said_in(words, language), most)


def tile_of(cell: WallCell, language: str, chosen: CellFilter, now: float) -> Tile:
    """What the tile shows for a reader of a language, at `now` (monotonic seconds)."""
    kind, read = cell.kind, cell.summary
    word: TextLike = say("wall_nothing_heard")
    figure, unit, is_live = "", "", False
    if read is not None:
        word = line_of_words(read.state.text, language, MAX_WORD)
        if read.figures:
            first = read.figures[0]
            figure = line_of_words(first.text, language, MAX_WORD)
            unit = line_of_words(first.unit, language, MAX_WORD)
            is_live = first.state == "live" and kind != "lost"
            figure = figure.removesuffix(f" {unit}") if unit else figure
    if cell.fault:
        word = say("wall_unreadable")
    if kind == "lost":
        word = say("wall_no_contact")
    return Tile(
        id=cell.id,
        name=one_line(cell.name, MAX_WORD),
        kind=kind,
        word=word,
        title=_title(cell),
        age=age_of(cell, now),
        number=figure,
        unit=unit,
        is_live=is_live,
        priority=cell.highest,
        url=read.url if read else "",
        mark=_mark(cell),
        is_dimmed=chosen.dims(cell),
    )


def age_of(cell: WallCell, now: float) -> TextLike:
    """For how long the cell has said nothing."""
    since = cell.lost_at if cell.lost_at is not None else cell.heard_at
    return "" if since is None else format_age(max(0.0, now - since))


def _title(cell: WallCell) -> TextLike:
    parts: list[TextLike] = []
    if cell.lost_at is not None:
        parts.append(say("wall_lost_since", time=format_time(cell.lost_wall)))
    if cell.fault:
        parts.append(say("wall_fault_of_summary", why=one_line(cell.fault, MAX_ALARM)))
    if cell.has_twin:
        parts.append(say("wall_twin"))
    return joined(parts)


def _mark(cell: WallCell) -> TextLike:
    """What must not be overlooked of a cell: that its name is another's too, or that it moves
    nothing."""
    if cell.has_twin:
        return say("wall_twin_short")
    return say("wall_simulated") if cell.summary and cell.summary.simulated else ""


def alarm_line(each: CellAlarm, number_in_cell: int, language: str, wall: float) -> AlarmLine:
    """At `wall` (seconds since the epoch)."""
    cell, alarm = each
    acknowledged, unacknowledged = STATE_WORDS[alarm.state]
    at, age = _times(alarm.since, wall)
    control = cell.summary.control if cell.summary else None
    holder = line_of_words(control.holder, language, MAX_WORD) if control else ""
    return AlarmLine(
        age_id=f"{cell.id}-{number_in_cell}",
        cell=one_line(cell.name, MAX_WORD),
        text=line_of_words(alarm.text, language, MAX_ALARM),
        priority=alarm.priority,
        priority_text=say(PRIORITY_WORDS[alarm.priority]),
        state=say(acknowledged if alarm.acknowledged else unacknowledged),
        at=at,
        age=age,
        url=cell.summary.url if cell.summary else "",
        control=say("wall_control", holder=holder) if holder else "",
    )


def _times(since: str, wall: float) -> tuple[TextLike, TextLike]:
    """The time of day, and the age; "" for what was not raised."""
    if not since:
        return "", ""
    at = datetime.fromisoformat(since).timestamp()
    return format_time(at), format_age(max(0.0, wall - at))


class SiteTiles(NamedTuple):
    name: str
    counts: Sequence[tuple[TileKind, str, TextLike]]
    cells: Sequence[WallCell]


class WallPage:
    """What one page shows: the cells that its filter lists, in its language. Tiles that have not
    changed are not rendered again."""

    _rendered: BoundedDict[tuple[str, str, bool], tuple[int, str]] = BoundedDict(KEPT_TILES)

    def __init__(
        self, wall: Wall, templates: PageTemplates, language: str, chosen: CellFilter, root: str
    ) -> None:
        self._wall, self._language, self._chosen, self._root = wall, language, chosen, root
        environment = templates.environment(language)
        self._parts: Any = environment.get_template("_wall.html").module

    @property
    def cells(self) -> list[WallCell]:
        return [cell for cell in self._wall.table.cells if self._chosen.lists(cell)]

    def sites(self) -> Iterator[SiteTiles]:
        by_site: dict[str, list[WallCell]] = {}
        for cell in self.cells:
            by_site.setdefault(cell.site, []).append(cell)
        for name, cells in by_site.items():
            yield SiteTiles(one_line(name, MAX_WORD), [*self._counts(cells)], cells)

    def _counts(self, cells: Sequence[WallCell] | None) -> Iterator[tuple[TileKind, str, TextLike]]:
        counts = self._wall.table.counts(cells)
        for kind in TILE_KINDS:
            if counts[kind] or (cells is None and kind == "running"):
                yield kind, str(counts[kind]), COUNT_WORDS[kind]

    def tile(self, cell: WallCell) -> str:
        """The HTML of a tile."""
        key = cell.id, self._language, self._chosen.dims(cell)
        known = self._rendered.get(key)
        if known is not None and known[0] == cell.version:
            return known[1]
        shown = tile_of(cell, self._language, self._chosen, time.monotonic())
        html = str(self._parts.tile(shown)).strip()
        self._rendered[key] = cell.version, html
        return html

    def in_view(self, first: str, last: str) -> list[WallCell]:
        """The cells from one to another, by their ids, and some around them."""
        cells = self.cells
        places = {cell.id: at for at, cell in enumerate(cells)}
        begin = max(0, places.get(first, 0) - MARGIN)
        end = places.get(last, begin + MAX_IN_VIEW) + MARGIN + 1
        return cells[begin : min(end, begin + MAX_IN_VIEW)]

    def ages(self, cells: Sequence[WallCell]) -> dict[str, str]:
        """The texts that time alone changes, by the names that they have on the page."""
        now, wall = time.monotonic(), time.time()
        ages = {cell.id: render(age_of(cell, now), self._language) for cell in cells}
        for line in self.alarms(wall):
            ages[line.age_id] = render(line.age, self._language)
        return ages

    def alarms(self, wall: float) -> Iterator[AlarmLine]:
        seen: dict[str, int] = {}
        for each in self._wall.table.totals.listed:
            place = seen[each.cell.id] = seen.get(each.cell.id, -1) + 1
            yield alarm_line(each, place, self._language, wall)

    def context(self) -> dict[str, Any]:
        """The variables of the parts around the tiles."""
        table, wall = self._wall.table, time.time()
        totals, alarms = table.totals, [*self.alarms(wall)]
        first = totals.listed[0] if totals.listed else None
        return {
            "words": WORDS,
            "state": state_of_wall(self._wall),
            "sums": [*self._counts(None)],
            "alarms": alarms,
            "line": alarms[0] if first and not first.alarm.acknowledged else None,
            "active": say("wall_active", count=number(str(totals.standing))),
            "listed": say(
                "wall_alarms_listed",
                listed=number(str(len(alarms))),
                all=number(str(totals.standing)),
            ),
            "unacknowledged": str(totals.unacknowledged),
            "left_out": self._left_out(),
            "filters": [*self._filters()],
            "site_links": [*self._site_links()],
            "chosen": self._chosen,
        }

    def _left_out(self) -> TextLike:
        count = self._wall.table.left_out
        return say("wall_left_out", count=number(str(count))) if count else ""

    def _filters(self) -> Iterator[tuple[str, TextLike, str, bool]]:
        """(address, words, count, whether it is chosen)"""
        cells = self.cells
        for show, words in FILTERS.items():
            chosen = CellFilter(show, self._chosen.site, self._chosen.text)
            count = sum(not chosen.dims(cell) for cell in cells)
            yield self._address(chosen), words, str(count), show == self._chosen.show

    def _site_links(self) -> Iterator[tuple[str, TextLike, bool]]:
        sites = self._wall.table.sites
        if len(sites) < 2:
            return
        for site in ("", *sites):
            words: TextLike = one_line(site, MAX_WORD) if site else say("wall_all_sites")
            chosen = CellFilter(self._chosen.show, site, self._chosen.text)
            yield self._address(chosen), words, site == self._chosen.site

    def _address(self, chosen: CellFilter) -> str:
        query = query_of(chosen)
        return f"{self._root}/?{query}" if query else f"{self._root}/"

    def parts(self) -> dict[str, str]:
        """The HTML of the parts around the tiles, by the ids of their elements. Ages change by
        themselves."""
        context = self.context()
        return {name: str(getattr(self._parts, name)(context)).strip() for name in PARTS}


PARTS: Final = ("wall_state", "wall_line", "wall_sums", "wall_alarms")


def query_of(chosen: CellFilter) -> str:
    """The query of a page with this filter."""
    values = {"show": chosen.show, "site": chosen.site, "text": chosen.text}
    return urlencode({name: value for name, value in values.items() if value not in ("", "all")})

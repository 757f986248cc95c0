"""The pages of a draft: by namespace or node, none with more widgets than a screen has room for."""

from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from itertools import takewhile
from typing import Final

from app.scaffold.displays import NODES_PAGE
from app.scaffold.draft_parts import DraftWidget
from app.scaffold.labels import with_own_labels
from app.scaffold.naming import GENERAL

MOST_WIDGETS: Final = 16  # four rows of gauges, which 1280x800 has above a trend
MOST_PAGES: Final = 8  # tabs on that screen
MOST_PENS: Final = 4
TREND_GAP_S: Final = 5  # the max_age_s of a trend that has none
TREND_KEYS: Final = ("topic", "type", "qos", "field", "label", "unit", "scale", "format")
CONTROLS_ONLY: Final = "The controls of this page are in the panel file, commented out"
ORDER: Final = ("indicator", "gauge", "readout", "joints", "camera", "table", "log")
Place = tuple[str, ...]


def make_pages(
    entries: Sequence[DraftWidget], live: bool
) -> tuple[dict[str, Sequence[DraftWidget]], list[DraftWidget]]:
    """Page → widgets, and the widgets beyond the most pages. Displays come first, then their trend,
    then controls; `live`: controls take room too, as they are not comments."""
    arranged = (_arranged(entries, own, live) for own in range(MOST_PAGES, -1, -1))
    pages: dict[str, list[DraftWidget]] = {}
    for pages in arranged:
        if len(pages) <= MOST_PAGES:
            break
    fullest = sorted(pages, key=lambda page: (page != NODES_PAGE, -len(pages[page])))[:MOST_PAGES]
    rest = [entry for page, part in pages.items() if page not in fullest for entry in part]
    kept: dict[str, Sequence[DraftWidget]] = {
        page: _whole(page, part) for page, part in pages.items() if page in fullest
    }
    return kept or {GENERAL: []}, rest


def _arranged(entries: Sequence[DraftWidget], own: int, live: bool) -> dict[str, list[DraftWidget]]:
    """The entries by the titles of pages: the `own` largest places have pages of their own."""
    pages: dict[str, list[DraftWidget]] = {}
    by_place = _by_place(entries, own)
    for place in sorted(by_place, key=lambda place: (place == (NODES_PAGE,), place)):
        is_general = place == (GENERAL,)
        for part in _parts(by_place[place], 0 if is_general else 1, live):
            title = " ".join(place if is_general else _common(part))
            taken = sum(page == title or page.rpartition(" ")[0] == title for page in pages)
            pages[f"{title} {taken + 1}" if title in pages else title] = part
    return pages


def _by_place(entries: Sequence[DraftWidget], own: int) -> dict[Place, list[DraftWidget]]:
    """The entries by the first part of their places. Small places are put together."""
    sizes = Counter(entry.place[:1] for entry in entries)
    kept = {place for place, size in sizes.most_common(own) if size > 1} | {(NODES_PAGE,)}
    by_place: defaultdict[Place, list[DraftWidget]] = defaultdict(list)
    for entry in entries:
        place = entry.place[:1]
        by_place[place if place in kept else (GENERAL,)].append(entry)
    return by_place


def _parts(entries: Sequence[DraftWidget], depth: int, live: bool) -> list[list[DraftWidget]]:
    """The entries in parts with at most `MOST_WIDGETS`, those of one place together where they fit."""
    if _room(entries, live) <= MOST_WIDGETS:
        return [_in_order(entries)]
    if all(len(entry.place) <= depth for entry in entries):
        return _cut(entries, live)
    by_place: defaultdict[Place, list[DraftWidget]] = defaultdict(list)
    for entry in entries:
        by_place[entry.place[: depth + 1]].append(entry)
    parts: list[list[DraftWidget]] = []
    for place in sorted(by_place):
        for part in _parts(by_place[place], depth + 1, live):
            if parts and _room([*parts[-1], *part], live) <= MOST_WIDGETS:
                parts[-1] = _in_order([*parts[-1], *part])
            else:
                parts.append(part)
    return parts


def _room(entries: Sequence[DraftWidget], live: bool) -> int:
    return sum(live or not entry.control for entry in entries)


def _cut(entries: Sequence[DraftWidget], live: bool) -> list[list[DraftWidget]]:
    counted = [entry for entry in _in_order(entries) if live or not entry.control]
    comments = [entry for entry in _in_order(entries) if entry.control and not live]
    first, *others = (counted[n : n + MOST_WIDGETS] for n in range(0, len(counted), MOST_WIDGETS))
    return [[*first, *comments], *others]


def _in_order(entries: Sequence[DraftWidget]) -> list[DraftWidget]:
    shown = [entry for entry in entries if not entry.control]
    shown.sort(key=lambda entry: (ORDER.index(entry.kind), entry.name))
    controls = (entry for entry in entries if entry.control)
    acting = sorted(controls, key=lambda entry: (entry.kind, entry.name))
    return [*shown, *acting]


def _common(entries: Sequence[DraftWidget]) -> Place:
    """The first parts of the places that all have."""
    places = zip(*(entry.place for entry in entries), strict=False)
    return tuple(parts[0] for parts in takewhile(lambda parts: len({*parts}) == 1, places))


def _whole(page: str, entries: Sequence[DraftWidget]) -> list[DraftWidget]:
    shown = with_own_labels([entry for entry in entries if not entry.control])
    if not shown:
        keys = {"label": CONTROLS_ONLY, "size": "small", "span": 12}
        shown = [DraftWidget(kind="label", name=f"{page}/note", keys=keys)]
    return [*shown, *_trend(shown, page), *(entry for entry in entries if entry.control)]


def _trend(entries: Sequence[DraftWidget], page: str) -> Iterator[DraftWidget]:
    """A trend of the gauges of the unit that most of them have."""
    gauges = [entry for entry in entries if entry.kind == "gauge"]
    units = Counter(gauge.keys.get("unit", "") for gauge in gauges)
    same = [
        gauge for gauge in gauges if gauge.keys.get("unit", "") == max(units, key=units.__getitem__)
    ]
    pens = [{k: gauge.keys[k] for k in TREND_KEYS if k in gauge.keys} for gauge in same[:MOST_PENS]]
    if pens:
        keys = {"label": "Trend", "window": "5m", "keep": "8h", "pen": pens, "span": 12}
        longest = max(gauge.keys.get("max_age_s", 0) for gauge in same[:MOST_PENS])
        keys |= {"max_age_s": longest} if longest > TREND_GAP_S else {}
        comment = "Its history is kept in memory; disk = true keeps it over a restart."
        yield DraftWidget(kind="trend", name=f"{page}/trend", keys=keys, comment=comment)

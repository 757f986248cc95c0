"""Which screens a page with `fit` fits, computed from the sizes that static/css gives its parts.

The parts of such a page have fixed heights: neither a font nor a value changes them. Lengths are CSS
pixels. tests/browser/test_fit_in_browser.py holds all this against a browser.
"""

from collections.abc import Iterator
from typing import Final

from app.panel.layout import COLUMNS, Group, Page
from app.panel.model import Panel
from app.panel.widgets.families import BaseWidget
from app.panel.widgets.kinds import KINDS
from app.panel.widgets.tiles import ENTRY_MM, GAP_MM, KEY_MM, LOW_SCREEN, MIDDLE, NARROW, TOUCH, Screen
from app.system.errors import Note

LOW_GAP_MM: Final = 4.0  # between the buttons of the frame of a low screen
MANY_TABS: Final = 7
GAP: Final = 12.0  # between groups, and between the rows of a group
HEAD: Final = 48.0  # of a group
TABS_OF_GROUPS: Final = TOUCH


def fit_notes(panel: Panel) -> Iterator[Note]:
    """For each page that must fit: which of the panel's screens it fits, and why not the others."""
    for p, page in enumerate(panel.pages):
        if not page.fit or not panel.screens:
            continue
        if page.template:
            yield Note(f"page[{p}]", f"{page.template} decides what fits: look at it in a browser")
            continue
        short = {
            size: reason(panel, page, Screen.from_size(size, panel.mm_per_px)) for size in panel.screens
        }
        fitting = [size for size, why in short.items() if not why]
        said = [f"fits {', '.join(fitting)}"] if fitting else []
        said += [f"does not fit {size}: {why}" for size, why in short.items() if why]
        yield Note(f"page[{p}]", "; ".join(said))


def reason(panel: Panel, page: Page, screen: Screen) -> str:
    """Why a page does not fit a screen; "" where it does."""
    if screen.width < NARROW:
        return ""  # a phone shows it without keys, and scrolls
    if long := long_rail(panel, screen):
        return long
    space = page_height(panel, page, screen)
    width = page_width(panel, screen)
    for rows in arranged(page, screen):
        needed = 0.0
        for row in rows:
            heights = [
                group_height(group, screen, page, group_width(group, page, screen, width))
                for group in row
            ]
            needed += max(heights) + (GAP if needed else 0)
        if needed > space:
            named = ", ".join(f'"{group.title or page.title}"' for row in rows for group in row)
            return f"{named} needs {needed:.0f} px of height and has {space:.0f}"
        for group in (group for row in rows for group in row):
            if narrow := too_narrow(group, group_width(group, page, screen, width), screen):
                return narrow
    return ""


def page_height(panel: Panel, page: Page, screen: Screen) -> float:
    """What the frame leaves for the groups."""
    return screen.height - frame_top(panel, screen) - 2 * screen.pad_above


def frame_top(panel: Panel, screen: Screen) -> float:
    """The height of the header, the line of alarms and the robots' tabs."""
    is_badge = screen.height <= LOW_SCREEN and panel.alarm_rules.low_screens == "badge"
    alarms = screen.header if panel.has_alarms and not is_badge else 0.0
    robots = max(TOUCH, 11 * screen.mm) + 13 if panel.robots else 0.0
    return screen.header + alarms + robots


def page_width(panel: Panel, screen: Screen) -> float:
    """The width for the groups."""
    return screen.width - (screen.rail if panel.has_rail else 0) - 2 * screen.pad


def long_rail(panel: Panel, screen: Screen) -> str:
    """Why not all tabs are seen beside the buttons of the frame; "" where they are."""
    more = panel.log.enabled + panel.has_alarms
    tabs = len(panel.pages) + bool(panel.recipes) + more if panel.has_rail else 0
    low = screen.height <= LOW_SCREEN
    if low and tabs >= MANY_TABS:
        tabs -= panel.log.enabled  # it is in the menu there
    stops = {widget.id for widget in panel.stops}
    keys = [
        screen.touch(ENTRY_MM if low and widget.id not in stops else KEY_MM)
        for widget in panel.frame.widgets
    ]
    gaps = (LOW_GAP_MM if low else GAP_MM) * screen.mm * (len(keys) - 1) if keys else 0.0
    needed = tabs * TOUCH + sum(keys) + gaps + (8 + screen.pad if keys else 0.0)
    space = screen.height - frame_top(panel, screen)
    if needed <= space:
        return ""
    return f"tabs and buttons of the frame need {needed:.0f} px of height and have {space:.0f}"


def arranged(page: Page, screen: Screen) -> list[list[list[Group]]]:
    """The rows of groups that are seen at once; more than one arrangement where groups take turns."""
    groups = page.parts
    if screen.is_wide or (screen.width >= MIDDLE and len(groups) == 1):
        rows: list[list[Group]] = []
        left = 0
        for group in groups:
            if group.span > left:
                rows.append([])
                left = COLUMNS
            rows[-1].append(group)
            left -= group.span
        return [rows]
    if screen.is_upright and len(groups) > 1:
        return [[[groups[0]], [other]] for other in groups[1:]]
    return [[[group]] for group in groups]


def group_width(group: Group, page: Page, screen: Screen, width: float) -> float:
    """The width inside a group."""
    if screen.is_wide:
        span = group.span
    else:
        span = COLUMNS // 2 if screen.width >= MIDDLE and len(page.parts) > 1 else COLUMNS
    return (width + GAP) * span / COLUMNS - GAP - 2 * screen.pad


def group_height(group: Group, screen: Screen, page: Page, width: float) -> float:
    """The height that a group of this inner width needs, with its padding and heading."""
    heights = row_heights(group, screen, width)
    inside = sum(heights) + GAP * (len(heights) - 1)
    alone = not screen.is_wide and len(page.parts) > 1
    if not alone:
        head = HEAD if group.title else screen.pad_above
    elif screen.width < MIDDLE and not screen.is_upright:
        head = TABS_OF_GROUPS + screen.pad_above
    elif group is page.parts[0] or len(page.parts) == 2:
        head = HEAD if group.title else screen.pad_above
    else:
        head = TABS_OF_GROUPS + screen.pad_above
    return head + inside + screen.pad_above


def row_heights(group: Group, screen: Screen, width: float) -> list[float]:
    """The heights of the rows of a group of this inner width, as the browser places its widgets."""
    heights: list[float] = []
    for widget, row, rows in group.cells():
        heights += [0.0] * (row + rows - len(heights))
        height = KINDS[widget.kind].tile.height_at(
            widget, screen, cell_width(group, widget, screen, width)
        )
        needed = (height - GAP * (rows - 1)) / rows
        for at in range(row, row + rows):
            heights[at] = max(heights[at], needed)
    return heights


def cell_width(group: Group, widget: BaseWidget, screen: Screen, width: float) -> float:
    """The width of a widget in a group of this inner width."""
    gap = GAP_MM * screen.mm
    column = (width - gap * (group.grid - 1)) / group.grid
    span = group.span_of(widget)
    return column * span + gap * (span - 1)


def too_narrow(group: Group, width: float, screen: Screen) -> str:
    """What is too narrow in a group of this inner width; "" where nothing is."""
    for widget in group.widgets:
        has = cell_width(group, widget, screen, width)
        needs = KINDS[widget.kind].tile.width(widget, screen)
        if has < needs - 0.5:
            return f'"{widget.label}" would be {has:.0f} px wide and needs {needs:.0f}'
    return ""

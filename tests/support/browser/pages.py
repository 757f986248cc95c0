"""Functions for any page in tests."""

import time
from typing import Any, Final

from playwright.sync_api import FloatRect, Frame, Locator, Page

from tests.support.parts import until

# Hides a page as another window in front of it does; with `false` it shows again.
HIDE: Final = """(hidden) => {
  Object.defineProperty(document, "hidden", { value: hidden ?? true, configurable: true });
  document.dispatchEvent(new Event("visibilitychange"));
}"""

# Waits until what a new size changes is drawn.
DRAWN: Final = "() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"

# The heights that the rows of a group need, without the room that is left over.
ROWS: Final = """(number) => {
  return [...document.querySelectorAll(`[data-group="${number}"] > .grid`)].flatMap((grid) => {
    grid.style.alignContent = "start";
    grid.style.gridTemplateRows = "none";
    const rows = getComputedStyle(grid).gridTemplateRows;
    grid.style.alignContent = grid.style.gridTemplateRows = "";
    return rows.split(" ").map(parseFloat);
  });
}"""


def widget(page: Page | Frame, name: str) -> Locator:
    """The element of a widget, by its id."""
    return page.locator(f'[data-widget="{name}"]')


def press_button(page: Page | Frame, name: str) -> Locator:
    """The button that presses a widget. A locked widget has a second one, "…"."""
    return widget(page, name).locator("button:not(.more)")


def settled(page: Page | Frame, script: str) -> list[Any]:
    """What a script finds wrong on a page, once that is so for some seconds: what has just appeared
    gets its size a frame later."""
    ends = time.monotonic() + 3
    while (wrong := page.evaluate(script)) and time.monotonic() < ends:
        page.wait_for_timeout(100)
    return list(wrong)


def asked(button: Locator) -> Locator:
    """The question that a button asks, as soon as its script is there. The page's own scripts run."""
    dialog = button.page.get_by_role("dialog")

    def asks() -> bool:
        if not dialog.is_visible():
            button.click()
        return dialog.is_visible()

    until(asks, "it asks", every_s=0.2)
    return dialog


def place(element: Locator) -> FloatRect:
    """The position of a visible element, in px of the window."""
    box = element.bounding_box()
    assert box is not None, f"{element} is not visible"
    return box


def middle(element: Locator) -> tuple[float, float]:
    """The middle of a visible element, in px of the window."""
    box = place(element)
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2

"""Functions for any page in tests."""

import time
from contextlib import suppress
from typing import Any, Final

from playwright.sync_api import FloatRect, Frame, Locator, Page, expect

from tests.support.parts import until

# Hides a page as another window in front of it does; with `false` it shows again.
HIDE: Final = """(hidden) => {
  Object.defineProperty(document, "hidden", { value: hidden ?? true, configurable: true });
  document.dispatchEvent(new Event("visibilitychange"));
}"""

COMES_WITHIN_MS: Final = 1000

# Waits until what a new size changes is drawn.
DRAWN: Final = "() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"

# The texts of tiles of users that are cut.
CUT_TILES: Final = """(tiles) => [...tiles.querySelectorAll("b, small, .tile > span")]
  .filter((text) => text.scrollWidth > text.clientWidth + 1 || text.scrollHeight > text.clientHeight + 1
    || text.getBoundingClientRect().bottom > text.closest(".tile").getBoundingClientRect().bottom)
  .map((text) => text.textContent.trim())"""

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


def without_its_time(page: Page) -> None:
    """The page as one that was opened a while ago: a press soon after it counts as a second tap."""
    page.evaluate("document.querySelectorAll('[name=_since]').forEach((field) => field.remove())")


def follow(link: Locator) -> None:
    """Clicks a link, or the button of a form, and waits for the whole of the next page."""
    with link.page.expect_navigation(wait_until="domcontentloaded"):
        link.click()


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


def comes(element: Locator) -> bool:
    """Whether an element is there within a second, as what a touch has begun."""
    with suppress(AssertionError):
        expect(element).to_have_count(1, timeout=COMES_WITHIN_MS)
        return True
    return False


def hold_by_key(button: Locator, held: Locator) -> None:
    """Holds a button by the space bar: as soon as its script is there, and the stream has enabled it,
    `held` is shown."""
    keyboard = button.page.keyboard

    def begins() -> bool:
        keyboard.up(" ")
        button.focus()
        keyboard.down(" ")
        return comes(held)

    until(begins, "it is held")


def place(element: Locator) -> FloatRect:
    """The position of a visible element, in px of the window."""
    box = element.bounding_box()
    assert box is not None, f"{element} is not visible"
    return box


def middle(element: Locator) -> tuple[float, float]:
    """The middle of a visible element, in px of the window."""
    box = place(element)
    return box["x"] + box["width"] / 2, box["y"] + box["height"] / 2


SQUEEZED: Final = """() => [...document.querySelectorAll("main .cell *")]
    .filter((part) => part instanceof HTMLElement && part.checkVisibility())
    .filter((part) => getComputedStyle(part).overflowY !== "visible")
    .filter((part) => part.clientHeight > 1 || getComputedStyle(part).clipPath === "none")
    .filter((part) => part.scrollHeight > part.clientHeight + 4 && part.clientHeight < 100)
    .map((part) => `${part.closest(".cell").id} ${part.tagName} ${part.className}`)"""


def squeezed(page: Page) -> list[str]:
    """What scrolls within less than 100 px: lists of widgets that have no room. Not what is only read
    aloud."""
    return list(page.evaluate(SQUEEZED))

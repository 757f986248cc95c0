"""What needs its place, with each set of fonts that a kiosk may have, without the panel's own."""

from typing import Final

import pytest
from playwright.sync_api import FloatRect, Page, expect

from tests.browser.test_control_in_browser import (
    FIRST,
    SECOND,
    Opens,
    bar,
    button,
    kiosk,
    opens,
    reused_pages,
    take,
    tap,
)
from tests.browser.test_pages import SIZES
from tests.cell.session.test_several_robots import MANY, heard, ten
from tests.support.browser.fonts import SETS, WITHOUT_OWN
from tests.support.browser.pages import DRAWN, place
from tests.support.parts import TAP_AGAIN_MS, Server, until

pytestmark = pytest.mark.long("detail")

__all__ = ["kiosk", "opens", "reused_pages", "ten"]  # fixtures


SCROLLED: Final = "() => [document.documentElement.scrollWidth, document.documentElement.scrollHeight]"


@pytest.fixture(scope="module", params=SETS)
def fonts(request: pytest.FixtureRequest) -> str:
    return f"{request.param}{WITHOUT_OWN}"


def publish_at(page: Page, size: tuple[int, int]) -> FloatRect:
    """Where the button is in a window of this size."""
    page.set_viewport_size({"width": size[0], "height": size[1]})
    page.evaluate(DRAWN)
    return place(button(page, "Publish"))


LOADED: Final = """() =>
  [...document.fonts].filter(({ status }) => status === "loaded").map(({ family }) => family)"""


def test_letters_are_those_of_the_system(opens: Opens) -> None:
    own = ("IBM Plex Sans", "Shipped JP")
    assert not [family for family in opens(FIRST).evaluate(LOADED) if family.strip('"') in own]


def test_control_bar_fits_and_does_not_shift_on_a_control_request(opens: Opens) -> None:
    first, second = opens(FIRST), opens(SECOND)
    take(first)
    before = {size: publish_at(first, size) for size in SIZES}
    tap(second, "Request control")
    expect(button(first, "Keep")).to_be_visible()
    for width, height in SIZES:
        assert publish_at(first, (width, height)) == before[width, height]
        for page in (first, second):
            page.set_viewport_size({"width": width, "height": height})
            page.evaluate(DRAWN)
            assert page.evaluate(SCROLLED) <= [width, height]
            assert bar(page).evaluate("e => e.scrollWidth <= e.clientWidth")
            bar(page).click()
            whole = page.locator("#whole > p")
            expect(whole).to_have_text(bar(page).text_content() or "")
            assert whole.evaluate("e => e.scrollHeight <= e.clientHeight + 1")
            page.keyboard.press("Escape")
            for shown_button in page.locator("#control button:visible").all():
                box = place(shown_button)
                assert box["height"] >= 44
                assert box["width"] * 0.22 >= 19.9
        left, right = place(button(first, "Give")), place(button(first, "Keep"))
        assert (right["x"] - left["x"] - left["width"]) * 0.22 >= 4.9


# With all lamps at their longest: where they begin and end, and where the header's last key ends.
LONGEST = """() => {
  const place = (name) => document.querySelector(name).getBoundingClientRect();
  const before = place(".lamps");
  for (const text of document.querySelectorAll(".lamps b")) text.textContent = "no connection";
  const after = place(".lamps");
  return [before.left, after.left, before.right, after.right, place(".menu-key").right];
}"""


def test_beside_the_banner_the_lamps_keep_their_place_whatever_they_say(
    demo: Server, page: Page
) -> None:
    for width, height in SIZES:
        page.set_viewport_size({"width": width, "height": height})
        page.goto(demo.url)
        expect(page.locator("#banner")).to_be_visible()
        expect(page.locator('.lamps > :not([data-state="ok"])')).to_have_count(0)
        left, then_left, right, then_right, end = page.evaluate(LONGEST)
        assert (left, right) == (then_left, then_right)
        assert end <= width


def test_ten_robots_fit_the_screen(ten: Server, page: Page) -> None:
    page.set_viewport_size({"width": 1024, "height": 600})
    page.goto(f"{ten.url}/robots/r10/")
    tabs = page.locator("[data-robot]")
    expect(tabs).to_have_count(MANY)
    for tab in tabs.all():
        box = place(tab)
        assert box["width"] >= 20 / 0.22  # millimetres
        assert box["height"] >= 12 / 0.22 - 0.1  # as all of the frame that is touched
        name = tab.locator("span")
        assert name.evaluate("e => e.scrollWidth <= e.clientWidth"), name.text_content()
    last = place(page.get_by_role("button", name="Publish2"))
    assert last["y"] + last["height"] <= 600  # a panel with one page has no rail
    page.get_by_role("link", name="Robot 7").click()
    expect(page.locator("h1")).to_have_text("Robot 7 Robot cell 1")
    expect(page.locator("html[data-floor]")).to_be_attached()  # its scripts are there
    last_heard = page.locator('[data-widget="last_heard"]')

    def is_heard() -> bool:
        """A server that stalled refuses the press."""
        page.get_by_label("Message").fill("from the screen")
        page.get_by_role("button", name="Publish", exact=True).click()
        return "from the screen (/operation)" in last_heard.inner_text()

    until(is_heard, "the robot has it", every_s=TAP_AGAIN_MS / 1000)
    assert "from the screen" not in heard(ten.robot("r10"))

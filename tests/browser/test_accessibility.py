"""What axe-core finds on the pages, what a keyboard reaches, how large targets are, and that nothing
moves once a page is there."""

from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from importlib.resources import files
from typing import Any, Final

import pytest
from playwright.sync_api import Browser, Page, ViewportSize, expect

from app.panel import load_panel
from app.system.settings import PACKAGE
from app.system.texts.catalogue import files as files_of_languages
from app.web.language import COOKIE as LANGUAGE
from app.web.pages.display_choice import CHOICES, COOKIE
from tests.cell.session.test_robots_on_one_page import panel_file
from tests.support.browser.browsers import HAS_FONTS, ReusedPage
from tests.support.browser.line import Line
from tests.support.browser.pages import DRAWN, place
from tests.support.parts import ROOT, Server, until
from tests.support.servers import ready

pytestmark = pytest.mark.long("detail")

AXE: Final = (files("axe_playwright_python") / "axe.min.js").read_text(encoding="utf-8")
# Rules of WCAG 2.2 A and AA, and axe's best practices; and those of them that depend on a theme.
ALL: Final = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice"]
OF_COLOURS: Final = ["color-contrast", "link-in-text-block"]
RUN: Final = """async (runOnly) => {
  const found = await axe.run(document, { runOnly, resultTypes: ["violations"] });
  return found.violations.map(({ id, help, nodes }) => [
    id, help, nodes.slice(0, 4).map((n) => [n.target.join(" "), ...n.any.map((a) => a.message)]),
  ]);
}"""
SHOW: Final = "(theme) => (document.documentElement.dataset.theme = theme)"
EXAMPLE: Final = "docs/examples/palletizer.toml"
PAGES: Final = ("cell", "operation", "recipe", "robot", "watch")
OF_SHIPPED: Final = (*(f"/pages/{name}" for name in PAGES), "/gallery", "/log", "/help")
MM_PER_PX: Final = 0.22
TOUCH: Final = 44.0


@pytest.fixture(scope="module")
def shipped() -> Iterator[Server]:
    yield from demo("app/panel.toml")


@pytest.fixture(scope="module")
def example() -> Iterator[Server]:
    yield from demo(EXAMPLE)


@pytest.fixture(scope="module")
def plan() -> Iterator[Server]:
    yield from demo("docs/examples/plan/panel.toml")


def demo(panel: str) -> Iterator[Server]:
    with ready(Server(ROOT, KIOSK_PANEL=panel, KIOSK_MODE="demo", KIOSK_DEV="1")) as mine:
        yield mine


@pytest.fixture(scope="module")
def reused_page(chromium: Browser) -> Iterator[ReusedPage]:
    """Axe may be added to its pages."""
    mine = ReusedPage(chromium, bypass_csp=True)
    yield mine
    mine.close()


def violations(page: Page, themes: Sequence[str] = CHOICES["theme"]) -> list[Any]:
    """What axe finds on a page, in each theme: (theme, rule, help, elements). A theme changes colours
    only, so the rules about anything else are looked at once."""
    if not page.evaluate("'axe' in globalThis"):
        page.evaluate(AXE)
    reported: list[Any] = []
    for theme in themes:
        page.evaluate(SHOW, theme)
        rules = ALL if theme == CHOICES["theme"][0] else OF_COLOURS
        reported += [(theme, *violation) for violation in page.evaluate(RUN, rules)]
    page.evaluate(SHOW, CHOICES["theme"][0])
    return reported


# (selector, property, value) in each rule of a theme.
COLOUR_PROPERTIES: Final = (
    "color-scheme",
    "filter",
    "mix-blend-mode",
)  # the last two of a plan on a map
OF_THEMES: Final = """() => {
  const inside = (rule) => [...(rule.cssRules ?? [])].flatMap(inside).concat(
    rule.selectorText?.includes("[data-theme") ? [...rule.style].map((name) =>
      [rule.selectorText, name, rule.style.getPropertyValue(name).trim()]) : []);
  return [...document.styleSheets].flatMap(inside);
}"""


def test_a_theme_changes_colours_only(shipped: Server, page: Page) -> None:
    page.goto(f"{shipped.url}/gallery")
    properties = [each for each in page.evaluate(OF_THEMES) if each[1] not in COLOUR_PROPERTIES]
    assert len(properties) > 50
    assert [name for _, name, _ in properties if not name.startswith("--")] == []
    is_colour = "(values) => values.filter((one) => !CSS.supports('color', one))"
    assert page.evaluate(is_colour, [v for _, _, v in properties]) == []
    for theme in CHOICES["theme"]:
        page.context.add_cookies([{"name": COOKIE.format("theme"), "value": theme, "url": shipped.url}])
        page.goto(f"{shipped.url}/log")
        expect(page.locator("html")).to_have_attribute("data-theme", theme)


def test_axe_finds_nothing_on_the_example(example: Server, page: Page) -> None:
    for path in ("/pages/cell", "/pages/setup", "/log", "/nowhere"):
        page.goto(example.url + path)
        assert violations(page) == [], path


@pytest.mark.long("every screen")
@pytest.mark.parametrize("path", OF_SHIPPED)
def test_axe_finds_nothing_on_the_shipped_panel(shipped: Server, page: Page, path: str) -> None:
    """Each page, the gallery and the log; the languages take turns. The large gallery is seen in one
    theme: the contrast of the others' colours is tested by `tests/web/test_tokens.py`."""
    pages = [f"/pages/{described.id}" for described in load_panel(PACKAGE / "panel.toml").pages]
    assert pages == [shown for shown in OF_SHIPPED if shown.startswith("/pages/")]
    languages = sorted(files_of_languages())
    language = languages[OF_SHIPPED.index(path) % len(languages)]
    page.context.add_cookies([{"name": LANGUAGE, "value": language, "url": shipped.url}])
    page.goto(shipped.url + path)
    expect(page.locator("html")).to_have_attribute("lang", language)
    if path in pages:
        expect(page.locator("#state")).not_to_have_attribute("data-state", "unknown")
    themes = CHOICES["theme"][:1] if path == "/gallery" else CHOICES["theme"]
    assert violations(page, themes) == [], (path, language)


# Parts of a key's face that reach out of the key, and labels that the sign of a longer text lies on.
CROWDED: Final = """() => [...document.querySelectorAll(".gallery .key .face")].flatMap((face) => {
  const key = face.closest(".key").getBoundingClientRect();
  const beyond = [...face.children].filter((part) => !part.matches(".more") && part.checkVisibility())
    .filter((part) => {
      const { top, bottom, height } = part.getBoundingClientRect();
      return height && (top < key.top - 0.5 || bottom > key.bottom + 0.5);
    });
  const sign = face.querySelector(".more:not([hidden]) path, .more:not([hidden]) .icon");
  const text = document.createRange();
  text.selectNodeContents(face.querySelector(".label"));
  const of = sign?.getBoundingClientRect();
  const dots = of && { left: of.left, right: of.right, middle: (of.top + of.bottom) / 2 };
  const covered = dots && [...text.getClientRects()].filter(
    ({ left, right, top }) => left < dots.right && right > dots.left && top < dots.middle);
  return [...beyond, ...(covered?.length ? [sign] : [])].map((part) =>
    `${face.closest(".example").innerText}: ${part.outerHTML.slice(0, 60)}`);
})"""


SCREENS: Final = ((1280, 800), (1024, 600), (800, 480))


def test_gallery_targets_have_enough_room(shipped: Server, page: Page) -> None:
    """Each kind in each state, with the sentences of each language at each size."""
    for language in sorted(files_of_languages()):
        page.context.add_cookies([{"name": LANGUAGE, "value": language, "url": shipped.url}])
        page.goto(f"{shipped.url}/gallery")
        expect(page.locator("html")).to_have_attribute("lang", language)
        for width, height in SCREENS:
            page.set_viewport_size({"width": width, "height": height})
            expect(page.locator(".key .more:visible").first).to_be_visible()
            page.evaluate(DRAWN)
            assert page.evaluate(CROWDED) == [], (language, width)
            assert page.evaluate("document.documentElement.scrollWidth") == width
    old = page.locator('[data-kind="readout"][data-state="old"] .number > span')
    expect(old).to_have_css("text-decoration-line", "underline")


def test_the_shipped_pages_are_level(shipped: Server, page: Page) -> None:
    """Keys are at the end of their group, below the scale, and a trend's keys are one row."""
    page.goto(f"{shipped.url}/pages/robot")
    for width, height in SCREENS:
        page.set_viewport_size({"width": width, "height": height})
        gauge, step, grid = (
            place(page.locator(shown).first)
            for shown in ("[data-kind=gauge]", "[data-kind=step]", ".group.first > .grid.buttons")
        )
        assert gauge["y"] + gauge["height"] <= step["y"], width
        ends = [box["y"] + box["height"] for box in (step, grid)]
        assert ends[0] == pytest.approx(ends[1], abs=1), width
    page.goto(f"{shipped.url}/pages/watch")
    for width, height in SCREENS:
        page.set_viewport_size({"width": width, "height": height})
        expect(page.locator(".trend-keys")).to_be_visible()
        keys = [place(key) for key in page.locator(".trend-keys > button:visible").all()]
        assert len({box["y"] for box in keys}) == 1, width
        assert min(box["width"] for box in keys) >= 14 / MM_PER_PX - 0.5


def test_axe_finds_nothing_on_a_page_with_a_template(plan: Server, page: Page) -> None:
    page.goto(plan.url)
    assert violations(page) == []


@pytest.fixture(scope="module")
def robots(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    yield from demo(str(panel_file(tmp_path_factory.mktemp("cell"), 'mode = "demo"\n')))


@pytest.mark.parametrize("path", ["/robots/left/pages/robots", "/robots/left/pages/cell"])
def test_axe_finds_nothing_on_pages_of_several_robots(robots: Server, page: Page, path: str) -> None:
    """An overview, and a page with widgets of two robots."""
    page.goto(robots.url + path)
    expect(page.locator("#state")).not_to_have_attribute("data-state", "unknown")
    assert violations(page) == [], path


def test_axe_finds_nothing_in_dialogs(example: Server, page: Page) -> None:
    """Menu, links, and the question before a press."""
    page.goto(example.url)
    for opener in (".menu-key", ".lamps"):
        page.locator(opener).click()
        assert violations(page) == [], opener
        page.keyboard.press("Escape")
    page.locator("[data-widget=reset] > button:not(.more)").click()
    expect(page.locator("dialog:popover-open")).to_be_visible()
    assert violations(page) == []


def test_axe_finds_nothing_on_the_page_that_asks(example: Server, page: Page) -> None:
    """The question on a page of its own, as it is without scripts: posted by the browser itself."""
    page.goto(example.url)
    page.evaluate("""() => {
      const form = document.querySelector("form.page");
      form.action = "/widgets/reset";
      form.submit();
    }""")
    expect(page.locator("form.ask")).to_be_visible()
    assert violations(page) == []


def test_axe_finds_nothing_on_small_screens(example: Server, page: Page) -> None:
    page.goto(example.url)
    for width, height in ((390, 844), (800, 480), (1024, 600)):
        page.set_viewport_size({"width": width, "height": height})
        page.evaluate(DRAWN)
        assert violations(page) == [], (width, height)


# What can be reached, in the order of the document, and what Tab reached last.
CONTROLS: Final = """() => {
  const all = [...document.querySelectorAll("a[href], button, input:not([type=hidden]), select")];
  const open = all.filter((e) => e.checkVisibility() && !e.disabled && !e.closest("[inert]"));
  return [open.map((e) => all.indexOf(e)), all.indexOf(document.activeElement)];
}"""


@pytest.mark.long(None)
@pytest.mark.parametrize("path", ["/pages/cell", "/pages/setup"])
def test_every_control_is_reached_by_the_keyboard_in_order(
    example: Server, page: Page, path: str
) -> None:
    key = "start" if path.endswith("cell") else "load"

    def reached_and_open() -> tuple[list[int], list[int]] | None:
        """What Tab reaches and what is open; None where a lock came or fell in the meantime."""
        page.goto(example.url + path)
        expect(page.locator(f"[data-widget={key}] > button:not(.more)")).to_be_enabled()
        expect(page.locator("[data-step]:visible").first).to_be_visible()
        expected = page.evaluate(CONTROLS)[0]
        reached = []
        for _ in expected:
            page.keyboard.press("Tab")
            then_open, last = page.evaluate(CONTROLS)
            if then_open != expected:
                return None
            reached.append(last)
        return reached, expected

    reached, expected = until(reached_and_open, "no lock comes or falls", within_s=120)
    assert reached == expected


# The box in which a touch reaches a control, with its label where that is one with it.
BOXES: Final = """() => [...document.querySelectorAll(
    "a[href], button, input:not([type=hidden]), select")]
  .filter((e) => e.checkVisibility({ visibilityProperty: true }) && !e.closest(".more"))
  .map((e) => {
    const { width, height } = e.getBoundingClientRect();
    return [e.outerHTML.slice(0, 90), width, height];
  })"""
MAIN_KEYS: Final = ".cell > .key > button:not(.more), .action button:not(.more)"


@pytest.mark.long(None)
def test_touch_targets_are_large_enough(example: Server, page: Page) -> None:
    for path in ("/pages/cell", "/pages/setup"):
        page.goto(example.url + path)
        for width, height in (*SCREENS, (800, 1280)):
            page.set_viewport_size({"width": width, "height": height})
            page.locator(".menu-key").click()
            small = [box for box in page.evaluate(BOXES) if min(box[1], box[2]) < TOUCH - 0.5]
            assert small == [], (path, width)
            page.keyboard.press("Escape")
            least = TOUCH if height <= 560 else 20 / MM_PER_PX  # beside a key that cancels
            for key in page.locator(MAIN_KEYS).locator("visible=true").all():
                box = place(key)
                assert box["height"] >= least - 0.5
                assert box["width"] >= 20 / MM_PER_PX - 0.5
            stop = place(page.locator(".frame-keys .key > button:not(.more)"))
            assert min(stop["height"] / 12, stop["width"] / 18) * MM_PER_PX >= 1 - 0.01


# What moved, and whether the page has lost the server: the frame says so, in other words.
SHIFTS: Final = """globalThis.shifts = [];
globalThis.lost = false;
new PerformanceObserver((list) => {
  for (const entry of list.getEntries()) {
    // A key's own face, and a unit that stands after its number, may.
    const moved = entry.sources.filter(({ node }) => !node?.parentElement?.closest(".face, .number"));
    globalThis.shifts.push(...moved.map(({ node }) => node?.outerHTML?.slice(0, 90)));
  }
}).observe({ type: "layout-shift", buffered: true });
new MutationObserver(() => (globalThis.lost = true))
  .observe(document, { subtree: true, attributeFilter: ["data-cut"] });"""


def shifts(pages: Sequence[Page], url: str, states: Sequence[str]) -> list[list[str]]:
    """What moved on each page until the robot has been in all these states; nothing where one has lost
    the server in the meantime, as it may beside much work."""
    for page in pages:
        page.goto(url)
    for state in states:
        for page in pages:
            if state == "online":
                expect(page.locator("#state")).to_have_attribute("data-state", state)
            else:
                button = page.locator("[data-widget=start] > button:not(.more)")
                expect(button).to_be_enabled(enabled=state == "permitted")
    return [] if any(page.evaluate("lost") for page in pages) else [p.evaluate("shifts") for p in pages]


@pytest.mark.parametrize(
    ("path", "states"), [("/pages/setup", ["online"]), ("/", ["locked", "permitted"])]
)
def test_layout_does_not_shift_after_load(
    example: Server, chromium: Browser, path: str, states: list[str]
) -> None:
    """Values come, and locks come and fall: what a key says moves nothing but its own face."""
    sizes: list[ViewportSize] = [{"width": 1280, "height": 800}, {"width": 800, "height": 480}]
    with ExitStack() as stack:
        pages = [stack.enter_context(chromium.new_page(viewport=size)) for size in sizes]
        for page in pages:
            page.context.add_cookies([HAS_FONTS])  # a browser's first page gets its fonts late
            page.add_init_script(SHIFTS)
        url = example.url + path
        moved = until(lambda: shifts(pages, url, states), "pages keep their server", within_s=200)
    assert moved == [[] for _ in sizes]


SLOW: Final = 3_000  # bytes per second of a page that comes slowly
# Whether it was first drawn when all of it, but for the very end, was there.
DRAWN_WHOLE: Final = """() => {
  const { responseStart, responseEnd } = performance.getEntriesByType("navigation")[0];
  const drawn = performance.getEntriesByName("first-paint")[0].startTime;
  return drawn > 0.2 * responseStart + 0.8 * responseEnd;
}"""


def test_of_a_page_that_comes_slowly_no_half_is_drawn(example: Server, page: Page) -> None:
    with Line(example.port, SLOW) as line:
        page.goto(line.url)  # style sheet and scripts are there from now on
        line.slow = True
        page.goto(f"{line.url}/pages/setup", wait_until="domcontentloaded")
        line.slow = False
        expect(page.locator("#state")).to_have_attribute("data-state", "online")
        page.wait_for_function("() => performance.getEntriesByName('first-paint').length")
        assert page.evaluate(DRAWN_WHOLE)

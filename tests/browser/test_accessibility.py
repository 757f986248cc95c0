"""What axe-core finds on the pages, what a keyboard reaches, how large targets are, and that nothing
moves once a page is there."""

from collections.abc import Iterator
from importlib.resources import files
from typing import Any, Final

import pytest
from playwright.sync_api import Browser, Page, expect

from app.i18n.catalogue import files as files_of_languages
from app.panel import load_panel
from app.settings import PACKAGE
from app.web.display_choice import CHOICES, COOKIE
from app.web.language import COOKIE as LANGUAGE
from tests.support.pages import place
from tests.support.parts import ROOT, Server, until

AXE: Final = (files("axe_playwright_python") / "axe.min.js").read_text(encoding="utf-8")
# Rules of WCAG 2.2 A and AA, and axe's best practices.
RUN: Final = """async () => {
  const runOnly = ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice"];
  const found = await axe.run(document, { runOnly });
  return found.violations.map(({ id, help, nodes }) => [
    id, help, nodes.slice(0, 4).map((n) => [n.target.join(" "), ...n.any.map((a) => a.message)]),
  ]);
}"""
EXAMPLE: Final = "docs/examples/palletizer.toml"
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
    mine = Server(ROOT, KIOSK_PANEL=panel, KIOSK_MODE="demo", KIOSK_DEV="1")
    until(mine.ready, "ready")
    yield mine
    mine.end()


@pytest.fixture(params=CHOICES["theme"])
def theme(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def themed(theme: str, chromium: Browser) -> Iterator[Page]:
    """A page of a browser that has chosen a theme; axe may be added to it."""
    context = chromium.new_context(bypass_csp=True, viewport={"width": 1280, "height": 800})
    name = COOKIE.format("theme")
    context.add_cookies([{"name": name, "value": theme, "domain": "127.0.0.1", "path": "/"}])
    yield context.new_page()
    context.close()


def violations(page: Page) -> list[Any]:
    page.evaluate(AXE)
    found: list[Any] = page.evaluate(RUN)
    return found


def test_axe_finds_nothing_on_the_example(example: Server, themed: Page) -> None:
    for path in ("/pages/cell", "/pages/setup", "/log", "/nowhere"):
        themed.goto(example.url + path)
        assert violations(themed) == [], path


def test_axe_finds_nothing_on_the_shipped_panel(shipped: Server, themed: Page, theme: str) -> None:
    """Each page, the gallery and the log, in each theme and in each language: the languages take turns,
    since contrast is a matter of themes and structure is not."""
    languages = sorted(files_of_languages())
    pages = [f"/pages/{described.id}" for described in load_panel(PACKAGE / "panel.toml").pages]
    for number, path in enumerate([*pages, "/gallery", "/log"], CHOICES["theme"].index(theme)):
        language = languages[number % len(languages)]
        themed.context.add_cookies([{"name": LANGUAGE, "value": language, "url": shipped.url}])
        themed.goto(shipped.url + path)
        expect(themed.locator("html")).to_have_attribute("lang", language)
        if path in pages:
            expect(themed.locator("#state")).not_to_have_attribute("data-state", "unknown")
        assert violations(themed) == [], (path, language)


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


def test_nothing_is_crowded_in_the_gallery(shipped: Server, chromium: Browser) -> None:
    """Each kind in each state, with the sentences of each language at each size."""
    with chromium.new_context() as context:
        page = context.new_page()
        for language in sorted(files_of_languages()):
            context.add_cookies([{"name": LANGUAGE, "value": language, "url": shipped.url}])
            for width, height in ((1280, 800), (1024, 600), (800, 480)):
                page.set_viewport_size({"width": width, "height": height})
                page.goto(f"{shipped.url}/gallery")
                expect(page.locator(".key .more:visible").first).to_be_visible()
                assert page.evaluate(CROWDED) == [], (language, width)
                assert page.evaluate("document.documentElement.scrollWidth") == width
        old = page.locator('[data-kind="readout"][data-state="old"] .number > span')
        expect(old).to_have_css("text-decoration-line", "underline")


def test_the_shipped_pages_are_level(shipped: Server, page: Page) -> None:
    """A scale ends where the keys of its row do, and a trend's keys are one row."""
    for width, height in ((1280, 800), (1024, 600), (800, 480)):
        page.set_viewport_size({"width": width, "height": height})
        page.goto(f"{shipped.url}/pages/robot")
        gauge, step = (place(page.locator(f"[data-kind={kind}]")) for kind in ("gauge", "step"))
        ends = [box["y"] + box["height"] for box in (gauge, step)]
        assert ends[0] == pytest.approx(ends[1], abs=1), width
        page.goto(f"{shipped.url}/pages/watch")
        expect(page.locator(".trend-keys")).to_be_visible()
        keys = [place(key) for key in page.locator(".trend-keys > button:visible").all()]
        assert len({box["y"] for box in keys}) == 1, width
        assert min(box["width"] for box in keys) >= 14 / MM_PER_PX - 0.5


def test_axe_finds_nothing_on_a_page_with_a_template(plan: Server, themed: Page) -> None:
    themed.goto(plan.url)
    assert violations(themed) == []


def test_axe_finds_nothing_in_what_opens(example: Server, themed: Page) -> None:
    """Menu, links, and the question before a press."""
    themed.goto(example.url)
    for opener in (".menu-key", ".lamps"):
        themed.locator(opener).click()
        assert violations(themed) == [], opener
        themed.keyboard.press("Escape")
    themed.locator("[data-widget=reset] > button").click()
    expect(themed.locator("dialog[open]")).to_be_visible()
    assert violations(themed) == []


def test_axe_finds_nothing_on_the_page_that_asks(example: Server, themed: Page) -> None:
    """The question on a page of its own, as it is without scripts: posted by the browser itself."""
    themed.goto(example.url)
    themed.evaluate("""() => {
      const form = document.querySelector("form.page");
      form.action = "/widgets/reset";
      form.submit();
    }""")
    expect(themed.locator("form.ask")).to_be_visible()
    assert violations(themed) == []


@pytest.mark.parametrize("size", [(390, 844), (800, 480), (1024, 600)])
def test_axe_finds_nothing_on_small_screens(example: Server, chromium: Browser, size: Any) -> None:
    width, height = size
    context = chromium.new_context(bypass_csp=True, viewport={"width": width, "height": height})
    page = context.new_page()
    page.goto(example.url)
    assert violations(page) == []
    context.close()


# What can be reached, in the order of the document, and what Tab reaches.
CONTROLS: Final = """() => {
  const all = [...document.querySelectorAll("a[href], button, input:not([type=hidden]), select")];
  return all.filter((e) => e.checkVisibility() && !e.disabled && !e.closest("[inert]"))
    .map((e, n) => { e.dataset.number = n; return n; });
}"""


@pytest.mark.parametrize("path", ["/pages/cell", "/pages/setup"])
def test_every_control_is_reached_by_the_keyboard_in_order(
    example: Server, page: Page, path: str
) -> None:
    page.set_viewport_size({"width": 1280, "height": 800})
    page.goto(example.url + path)
    key = "start" if path.endswith("cell") else "load"
    expect(page.locator(f"[data-widget={key}] > button")).to_be_enabled()
    expect(page.locator("[data-step]:visible").first).to_be_visible()
    expected = page.evaluate(CONTROLS)
    reached = []
    for _ in expected:
        page.keyboard.press("Tab")
        reached.append(page.evaluate("Number(document.activeElement.dataset.number ?? -1)"))
    assert reached == expected


# The box in which a touch reaches a control, with its label where that is one with it.
BOXES: Final = """() => [...document.querySelectorAll(
    "a[href], button, input:not([type=hidden]), select")]
  .filter((e) => e.checkVisibility({ visibilityProperty: true }) && !e.closest(".more"))
  .map((e) => {
    const { width, height } = e.getBoundingClientRect();
    return [e.outerHTML.slice(0, 90), width, height];
  })"""
MAIN_KEYS: Final = ".cell > .key > button, .action button"


@pytest.mark.parametrize("size", [(1280, 800), (1024, 600), (800, 480), (800, 1280)])
def test_what_is_touched_is_large_enough(example: Server, page: Page, size: Any) -> None:
    width, height = size
    page.set_viewport_size({"width": width, "height": height})
    for path in ("/pages/cell", "/pages/setup"):
        page.goto(example.url + path)
        page.locator(".menu-key").click()
        small = [box for box in page.evaluate(BOXES) if min(box[1], box[2]) < TOUCH - 0.5]
        assert small == [], (path, size)
        page.keyboard.press("Escape")
        least = (14 if height <= 560 else 20) / MM_PER_PX
        for key in page.locator(MAIN_KEYS).locator("visible=true").all():
            box = place(key)
            assert box["height"] >= least - 0.5
            assert box["width"] >= 20 / MM_PER_PX - 0.5
    stop = place(page.locator(".frame-keys .key > button"))
    assert min(stop["height"] / 12, stop["width"] / 18) * MM_PER_PX >= 1 - 0.01


SHIFTS: Final = """new PerformanceObserver((list) => {
  globalThis.shifts ??= [];
  for (const entry of list.getEntries()) {
    // A key's own face, and a unit that stands after its number, may.
    const moved = entry.sources.filter(({ node }) => !node?.parentElement?.closest(".face, .number"));
    globalThis.shifts.push(...moved.map(({ node }) => node?.outerHTML?.slice(0, 90)));
  }
}).observe({ type: "layout-shift", buffered: true });"""


SLOWEST_MS: Final = 90_000  # of a page that comes slowly, to a busy machine
SLOW: Final = {"offline": False, "latency": 0, "downloadThroughput": 30_000, "uploadThroughput": 30_000}


@pytest.mark.parametrize("size", [(1280, 800), (800, 480)])
def test_nothing_moves_after_the_page_is_there(example: Server, chromium: Browser, size: Any) -> None:
    """Values come, and locks come and fall: what a key says moves nothing but its own face. The page
    comes slowly, as to a busy browser: half of it is not drawn."""
    width, height = size
    context = chromium.new_context(viewport={"width": width, "height": height})
    context.add_init_script(SHIFTS)
    context.set_default_navigation_timeout(SLOWEST_MS)
    page = context.new_page()
    network = context.new_cdp_session(page)
    network.send("Network.enable")
    network.send("Network.emulateNetworkConditions", SLOW)
    page.goto(f"{example.url}/pages/setup")
    expect(page.locator("#state")).to_have_attribute("data-state", "ready")
    assert page.evaluate("globalThis.shifts ?? []") == []
    page.goto(example.url)
    expect(page.locator("#state")).to_have_attribute("data-state", "locked")
    expect(page.locator("#state")).to_have_attribute("data-state", "ready")
    assert page.evaluate("globalThis.shifts ?? []") == []
    context.close()

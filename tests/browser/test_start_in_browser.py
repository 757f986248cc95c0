"""How a page starts: with what browsers say or lack, and locked where a part of it is missing."""

from collections.abc import Iterator
from contextlib import suppress
from functools import partial
from itertools import pairwise
from typing import Any, Final

import pytest
from playwright.sync_api import Browser, Error, Page, Request, Route, expect

from app.system.texts import render, say
from app.system.texts.catalogue import files
from app.web.language import COOKIE
from tests.support.browser.browsers import opened
from tests.support.browser.pages import HIDE
from tests.support.parts import ROOT, SHIPPED, Server, until
from tests.support.servers import ready

pytestmark = pytest.mark.promise("reconnect")

THROWS: Final = 'get() { throw new DOMException("denied", "SecurityError"); }, configurable: true'
NO_STORAGE: Final = "".join(
    f'Object.defineProperty(window, "{name}Storage", {{ {THROWS} }});' for name in ("session", "local")
)
# What a browser may say or lack, and a page works all the same.
ODDITIES: Final = {
    "language C": 'Object.defineProperty(Navigator.prototype, "language", { get: () => "C" })',
    "language with a modifier": """
        Object.defineProperty(Navigator.prototype, "language", { get: () => "en-US@posix" })""",
    "no language": 'Object.defineProperty(Navigator.prototype, "language", { get: () => undefined })',
    "no storage": NO_STORAGE,
    "no media queries": "delete window.matchMedia",
    "no timed signals": "delete AbortSignal.timeout",
    "no visibility check": "delete Element.prototype.checkVisibility",
}
# What the modules and style sheets do not work without.
NEEDS: Final = {
    "popovers": "delete HTMLElement.prototype.popover",
    "layers": "delete window.CSSLayerBlockRule",
    "selectors": "CSS.supports = (text) => !/:has/.test(text)",
    "containers": "CSS.supports = (text) => !/container/.test(text)",
}
FAULTS: Final[dict[str, dict[str, Any] | None]] = {
    "500": {"status": 500, "body": "Internal Server Error"},
    "a syntax error": {"content_type": "text/javascript", "body": "export const = ;"},
    "an error": {"content_type": "text/javascript", "body": 'throw new Error("at import");'},
    "nothing": None,
}
# The script of each part, with a page of the shipped panel that loads it. Those of questions and of
# sheets come later.
SCRIPTS: Final = {
    "main": "operation",
    "touches": "operation",
    "show": "operation",
    "press": "operation",
    "entries": "operation",
    "number-inputs": "recipe",
    "number-text": "recipe",
    "kinds/holds": "cell",
    "kinds/facts": "cell",
    "kinds/entries": "recipe",
    "kinds/gauge": "robot",
    "kinds/joints": "robot",
    "kinds/step": "robot",
    "kinds/table": "robot",
    "kinds/camera": "watch",
    "kinds/log": "watch",
    "kinds/trend": "watch",
    "trend/plot": "watch",
}
OPERATION: Final = "/pages/operation"
PAUSES_S: Final = (1, 2, 4, 8, 16, 30, 30)  # before the reloads of a page that stays incomplete
START_WAITS_S: Final = (10, 20, 40, 80, 120)  # for the next file: longer after each reload
SETTLED_S: Final = 60
# Timers of whole seconds end when the test says so.
KEEP_TIMERS: Final = """
    window.timers = [];
    const begin = window.setTimeout;
    window.setTimeout = (act, ms, ...values) => ms >= 1000 && ms % 1000 === 0
        ? timers.push({ act: () => act(...values), ms })
        : begin(act, ms, ...values);
"""


@pytest.fixture(scope="module")
def demo() -> Iterator[Server]:
    """A server with the shipped panel and its simulated robot."""
    with ready(Server(ROOT, KIOSK_PANEL=str(SHIPPED))) as mine:
        yield mine


@pytest.fixture
def tab(chromium: Browser) -> Iterator[Page]:
    """A page of which errors are expected."""
    context = opened(chromium)
    yield context.new_page()
    context.close()


def sentence(code: str, language: str = "en") -> str:
    return render(say(code), language)


def noted(page: Page, part: str) -> list[str]:
    """The requests from now on whose method or URL has this part."""
    requests: list[str] = []

    def note(request: Request) -> None:
        if part in f"{request.method} {request.url}":
            requests.append(request.url)

    page.on("request", note)
    return requests


def answer(page: Page, script: str, fault: str) -> None:
    """Answers requests for a script with a fault from now on."""

    def faulty(route: Route) -> None:
        response = FAULTS[fault]
        if response is None:
            route.abort()
        else:
            route.fulfill(**response)

    page.route(f"**/static/*/{script}.js", faulty)


def is_locked(page: Page) -> None:
    """The page says why, and nothing on it can be pressed."""
    expect(page.locator("body[data-locked]")).to_be_attached()
    expect(page.locator("#fault")).to_have_text(sentence("page_incomplete"))
    expect(page.locator("#fault")).to_be_visible()
    expect(page.locator("#state")).to_have_attribute("data-state", "unknown")
    assert page.locator("form.page [type=submit]:enabled, .hold:enabled").count() == 0
    for widget in page.locator("[data-widget][data-state]").all():
        expect(widget).to_have_attribute("data-state", "old")


# Returns false on a page that has just been loaded again, and is not locked yet.
PRESS_ALL: Final = """async () => {
  if (!("locked" in document.body.dataset)) return false;
  const form = document.querySelector("form.page");
  form.requestSubmit();
  for (const button of form.querySelectorAll("[type=submit]")) {
    button.disabled = false;
    await new Promise((done) => setTimeout(done)); // as a later script does it
    button.click();
  }
  return true;
}"""


def go(page: Page, url: str, **options: Any) -> None:
    """Opens a page; one that was locked before may be reloading itself, which aborts this."""

    def opened() -> bool:
        with suppress(Error):
            page.goto(url, **options)
            return True
        return False

    until(opened, f"{url} is open")


def presses_all_buttons(page: Page) -> bool:
    """Whether all buttons of a locked page were pressed; the page may be loaded again at any moment."""
    with suppress(Error):
        return bool(page.evaluate(PRESS_ALL))
    return False


def publish(page: Page) -> None:
    page.get_by_label("Message").fill("once")
    page.get_by_role("button", name="Publish", exact=True).click()
    expect(page.locator("#receipt-operation")).to_contain_text("Sent at")


@pytest.mark.long("every screen")
@pytest.mark.parametrize("oddity", ODDITIES)
def test_whatever_a_browser_says_or_lacks_the_page_works(
    demo: Server, own_page: Page, oddity: str
) -> None:
    own_page.add_init_script(ODDITIES[oddity])
    own_page.route("**/press-socket.js", lambda route: route.abort())  # a press is a POST
    for path in ("/pages/cell", "/pages/recipe", OPERATION):
        own_page.goto(demo.url + path)
        expect(own_page.locator("html[data-floor]")).to_be_attached()
    expect(own_page.get_by_role("button", name="Publish", exact=True)).to_be_enabled()
    publish(own_page)
    assert own_page.locator("body[data-locked]").count() == 0


@pytest.mark.parametrize("fault", FAULTS)
def test_a_page_whose_script_has_a_fault_is_locked_and_presses_nothing(
    demo: Server, tab: Page, fault: str
) -> None:
    posts = noted(tab, "POST")
    for script in ("main", "press", "show", "kinds/holds"):
        answer(tab, script, fault)
        go(tab, f"{demo.url}/pages/cell")
        is_locked(tab)
        until(lambda: presses_all_buttons(tab), "the locked page is pressed")
        is_locked(tab)
        assert posts == []
        tab.unroute_all()


@pytest.mark.long("every screen")
@pytest.mark.parametrize("script", SCRIPTS)
def test_each_script_is_needed(demo: Server, tab: Page, script: str) -> None:
    answer(tab, script, "500")
    go(tab, f"{demo.url}/pages/{SCRIPTS[script]}")
    is_locked(tab)


@pytest.mark.long("every screen")
@pytest.mark.parametrize("language", sorted(files()))
def test_a_page_is_locked_in_the_readers_language(demo: Server, tab: Page, language: str) -> None:
    tab.context.add_cookies([{"name": COOKIE, "value": language, "url": demo.url}])
    answer(tab, "main", "500")
    go(tab, demo.url + OPERATION)
    expect(tab.locator("#fault")).to_have_text(sentence("page_incomplete", language))
    expect(tab.locator("#why-operation")).to_contain_text(sentence("page_incomplete", language))


def kept_timers(page: Page) -> list[int]:
    """The times of the page's long timers, in seconds; they end when the test says so. Without those
    that wait for the start."""
    times: list[int] = page.evaluate("timers.map((timer) => timer.ms / 1000)")
    return [time for time in times if time not in START_WAITS_S]


def end_timer(page: Page, time_s: int) -> None:
    page.evaluate(
        "(ms) => timers.splice(timers.findIndex((timer) => timer.ms === ms), 1)[0].act()", 1000 * time_s
    )


@pytest.mark.long("detail")
@pytest.mark.parametrize("storage", ["", NO_STORAGE], ids=["storage", "no storage"])
def test_reloads_of_a_faulty_page_back_off_and_end_with_the_fault(
    demo: Server, tab: Page, storage: str
) -> None:
    tab.add_init_script(KEEP_TIMERS + storage)
    answer(tab, "touches", "500")
    go(tab, demo.url + OPERATION)
    for pause_s in PAUSES_S:
        is_locked(tab)
        assert kept_timers(tab) == [pause_s]
        with tab.expect_navigation():
            end_timer(tab, pause_s)
    is_locked(tab)
    tab.unroute_all()
    with tab.expect_navigation():
        end_timer(tab, PAUSES_S[-1])
    expect(tab.locator("html[data-floor]")).to_be_attached()
    expect(tab.get_by_role("button", name="Publish", exact=True)).to_be_enabled()
    tab.wait_for_function("() => timers.some((timer) => timer.ms === 60000)")
    end_timer(tab, SETTLED_S)
    answer(tab, "touches", "500")
    tab.reload()
    is_locked(tab)
    assert kept_timers(tab) == [PAUSES_S[0]]


def test_a_faulty_page_does_not_reload_while_its_server_is_gone(demo: Server, tab: Page) -> None:
    tab.add_init_script(KEEP_TIMERS)
    answer(tab, "touches", "500")
    go(tab, demo.url + OPERATION)
    is_locked(tab)
    tab.route("**/static/*/main.js", lambda route: route.abort())
    for pause_s, longer_s in pairwise(PAUSES_S[:4]):
        end_timer(tab, pause_s)
        tab.wait_for_function("(ms) => timers.at(-1).ms === ms", arg=1000 * longer_s)
    is_locked(tab)


def is_locked_after_waits(page: Page, wait_s: int) -> bool:
    """Ends a wait for the start; whether the page is locked then. It waits again if a file has arrived
    since the last one."""
    end_timer(page, wait_s)
    return bool(page.locator("body[data-locked]").count())


def test_a_script_that_never_arrives_locks_the_page(demo: Server, tab: Page) -> None:
    tab.add_init_script(KEEP_TIMERS)
    tab.route("**/static/*/press.js", lambda route: None)
    go(tab, demo.url + OPERATION, wait_until="domcontentloaded")
    for wait_s, longer_s in pairwise(START_WAITS_S[:3]):
        until(partial(is_locked_after_waits, tab, wait_s), "all else has arrived")
        is_locked(tab)
        with tab.expect_navigation(wait_until="domcontentloaded"):
            end_timer(tab, kept_timers(tab)[0])
        tab.wait_for_function("(ms) => timers.some((timer) => timer.ms === ms)", arg=1000 * longer_s)


@pytest.mark.long("detail")
def test_a_page_whose_scripts_arrive_slowly_waits_for_them(demo: Server, tab: Page) -> None:
    """On a busy machine they take minutes: the page does not begin again while they arrive."""
    held: list[Route] = []
    tab.add_init_script(KEEP_TIMERS)
    tab.route("**/static/*/*.js", lambda route: held.append(route))
    go(tab, demo.url + OPERATION, wait_until="commit")
    tab.wait_for_function("() => timers.length > 0")
    pages = noted(tab, OPERATION)
    while not tab.locator("html[data-floor]").count():
        arrived = tab.evaluate("performance.getEntriesByType('resource').length")
        until(lambda: bool(held), "a script is requested")
        held.pop(0).continue_()
        tab.wait_for_function("(n) => performance.getEntriesByType('resource').length > n", arg=arrived)
        if tab.evaluate("timers.some((timer) => timer.ms === 10000)"):
            end_timer(tab, START_WAITS_S[0])
        assert tab.locator("body[data-locked]").count() == 0
    assert pages == []


LATER: Final = {"press-socket"}  # a press waits for it, the page does not
PAGES: Final = (
    "/pages/cell",
    "/pages/recipe",
    "/pages/watch",
    OPERATION,
    "/alarms",
    "/log",
    "/diagnostics",
)


@pytest.mark.long("table")
@pytest.mark.parametrize("path", PAGES)
def test_a_page_requests_all_scripts_of_its_start_at_once(demo: Server, tab: Page, path: str) -> None:
    requested = noted(tab, "/static/")
    go(tab, demo.url + path)
    expect(tab.locator("html[data-floor]")).to_be_attached()
    links = tab.locator("link[rel=modulepreload]").evaluate_all("links => links.map(l => l.href)")
    assert {url for url in requested if url.endswith(".js")} - later(links) == set(links)


def later(links: list[str]) -> set[str]:
    """The scripts that come later, as URLs."""
    folder = links[0].rpartition("/")[0]
    return {f"{folder}/{name}.js" for name in LATER}


@pytest.mark.long("detail")
def test_a_faulty_page_stays_locked_when_it_is_shown_again(demo: Server, tab: Page) -> None:
    tab.add_init_script(KEEP_TIMERS)
    answer(tab, "touches", "500")
    go(tab, demo.url + OPERATION)
    is_locked(tab)
    streams = noted(tab, "/events")
    for hidden in (True, False):
        tab.evaluate(HIDE, hidden)
    assert tab.evaluate("fetch('/healthz').then((response) => response.status)") == 200
    assert streams == []
    is_locked(tab)


def test_press_that_fails_before_sending_says_not_sent(demo: Server, tab: Page) -> None:
    tab.route("**/press-socket.js", lambda route: route.abort())
    go(tab, demo.url + OPERATION)
    expect(tab.locator("html[data-floor]")).to_be_attached()
    button = tab.get_by_role("button", name="Publish", exact=True)
    expect(button).to_be_enabled()
    for broken in ("fetch = () => { throw new Error() }", "Date.prototype.toISOString = null"):
        tab.evaluate(f"() => {{ {broken} }}")
        button.click()
        expect(tab.locator("#receipt-operation")).to_have_text(sentence("page_press_not_sent"))
        expect(tab.locator("#receipt-operation")).to_have_attribute("data-outcome", "refused")
        expect(button).not_to_have_attribute("aria-busy", "true")


@pytest.mark.long("every screen")
@pytest.mark.parametrize("need", NEEDS)
@pytest.mark.parametrize("language", sorted(files()))
def test_a_browser_that_is_too_old_shows_that_and_nothing_else(
    demo: Server, tab: Page, need: str, language: str
) -> None:
    tab.context.add_cookies([{"name": COOKIE, "value": language, "url": demo.url}])
    tab.add_init_script(NEEDS[need])
    streams = noted(tab, "/events")
    go(tab, demo.url + OPERATION)
    expect(tab.locator("body")).to_have_text(sentence("browser_too_old", language))
    expect(tab.locator(".too-old")).to_be_visible()
    assert tab.locator("button, input, select, form").count() == 0
    assert streams == []


@pytest.mark.long("detail")
def test_overlays_are_hidden_without_the_popover_api(demo: Server) -> None:
    """In the markup, for a browser without scripts."""
    html = demo.http.get(OPERATION).text
    popovers = html.count(" popover")
    assert popovers == html.count(" popovertarget") + html.count('" popover hidden') + html.count(
        '"manual" hidden'
    )
    assert popovers > html.count(" popovertarget") > 0


@pytest.mark.long("detail")
def test_text_that_is_not_to_be_selected_is_so_in_webkit_too() -> None:
    for sheet in (ROOT / "static/css").rglob("*.css"):
        text = sheet.read_text()
        plain = text.count(" user-select:")
        assert text.count("-webkit-user-select:") == plain, sheet.name

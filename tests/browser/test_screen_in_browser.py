"""The frame and the groups on the screens that there are: nothing overflows, each group can be reached,
a key's whole text can be read, the menu works, and keys of the frame come back to their page."""

from collections.abc import Iterator
from pathlib import Path
from typing import Final

import pytest
from playwright.sync_api import CDPSession, Locator, Page, expect

from app.system.texts import sentences
from tests.browser.test_layout_in_browser import PANEL
from tests.support.browser.browsers import sized
from tests.support.browser.pages import DRAWN, place, settled, squeezed
from tests.support.panel_text import MAIN, START
from tests.support.parts import ROOT, TAP_AGAIN_MS, Server, until
from tests.support.servers import demo_server, ready

pytestmark = [pytest.mark.long("detail"), pytest.mark.promise("layout")]

PALLETIZER: Final = ROOT / "docs/examples/palletizer.toml"
SCREENS: Final = ((1280, 800), (1024, 600), (800, 480), (800, 1280), (390, 844))
# What is wider than its place, or beyond the screen: the page may only scroll down, inside the frame.
OVERFLOWS: Final = """() => {
  const root = document.documentElement, found = [];
  const seen = (names) => [...document.querySelectorAll(names)].filter((one) => one.checkVisibility());
  const name = (one) => one.className || one.tagName;
  if (root.scrollWidth > innerWidth || root.scrollHeight > innerHeight) found.push("the page");
  for (const one of seen("header, main, .group, .grid, .cell, .face, .pages, .frame-keys")) {
    if (one.scrollWidth > one.clientWidth + 1) found.push(name(one));
  }
  for (const one of seen("header > *, .pages > *, .frame-keys > *, .cell > *")) {
    const { left, right } = one.getBoundingClientRect();
    if (left < -1 || right > innerWidth + 1) found.push(`${name(one)}: ${left} to ${right}`);
  }
  return found;
}"""
# Numbers and words that are cut without a sign of it.
CUT: Final = """() => {
  const texts = document.querySelectorAll("h1 b, .robot-state b, .banner, #clock, .label, .value");
  const cut = (one) => one.scrollWidth > one.clientWidth + 1;
  const unsigned = ({ textOverflow, webkitLineClamp, display }) =>
    textOverflow !== "ellipsis" && webkitLineClamp === "none" && display !== "inline";
  return [...texts]
    .filter((one) => one.checkVisibility() && cut(one) && unsigned(getComputedStyle(one)))
    .map((one) => one.textContent);
}"""
SAYS: Final = """(shown, [state, text, language]) => {
  shown.dataset.state = state;
  shown.lastElementChild.textContent = text;
  shown.lastElementChild.lang = language;
}"""
LOCK_ALL: Final = """() => {
  for (const key of document.querySelectorAll(".key")) {
    key.querySelector("button").disabled = true;
    key.querySelector(".face > p").textContent = "longer than the face of a key ".repeat(9);
  }
}"""
KEYS: Final = 40
LONG: Final = (
    "A text that has much more to say than two lines of a key on a small screen can hold, to its end"
)
DOORS: Final = "/cell/infeed/guard_doors_are_closed/and_are_locked/by_the_controller/of_this_robot"
HOLDS_MORE: Final = f"""
title = "Long texts"
mode = "demo"
[[interlock]]
id = "operation"
topic = "{DOORS}"
[[page]]
id = "one"
title = "One"
[[page.group]]
columns = 6
[[page.group.widget]]
id = "locked"
kind = "publish"
label = "Locked"
topic = "/operation1"
type = "std_msgs/msg/String"
message = {{ data = "" }}
interlock = "operation"
[[page.group.widget]]
id = "go"
kind = "publish"
label = "Go"
topic = "/operation"
type = "std_msgs/msg/String"
message = {{ data = "" }}
[[page.group.widget]]
id = "reset"
kind = "call"
label = "Reset"
service = "/reset"
type = "std_srvs/srv/Trigger"
answer = "{LONG}"
[demo."{DOORS}"]
silent = true
"""


@pytest.fixture(scope="module")
def cell() -> Iterator[Server]:
    """The demo robot with the palletizer's panel: groups, a frame with Stop, two pages."""
    with ready(Server(ROOT, KIOSK_PANEL=str(PALLETIZER))) as mine:
        yield mine


@pytest.fixture(scope="module")
def several(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """Several robots, control and long labels."""
    with demo_server(tmp_path_factory.mktemp("panel"), PANEL) as mine:
        yield mine


@pytest.fixture(scope="module")
def long(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with demo_server(tmp_path_factory.mktemp("panel"), HOLDS_MORE) as mine:
        until(lambda: mine.widget("go")["enabled"], "the robot is there")
        yield mine


def button(page: Page, name: str) -> Locator:
    return page.get_by_role("button", name=name, exact=True)


@pytest.mark.long(None)
@pytest.mark.parametrize("look", ["normal", "large"])
def test_no_element_overflows_on_any_screen(
    cell: Server, several: Server, page: Page, look: str
) -> None:
    for url in (f"{cell.url}/pages/cell", f"{cell.url}/pages/setup", several.url):
        page.context.add_cookies([{"name": "kiosk_text_size", "value": look, "url": url}])
        page.goto(url)
        expect(page.locator(f'html[data-text-size="{look}"]')).to_be_attached()
        expect(page.locator("#clock")).not_to_be_empty()
        for width, height in SCREENS:
            sized(page, width, height).evaluate(DRAWN)
            assert settled(page, OVERFLOWS) == [], f"{url}, {width}"
            assert settled(page, CUT) == [], f"{url}, {width}"


@pytest.mark.parametrize("language", ["en", "ja", "de"])
def test_each_state_of_the_robot_fits_a_phone(cell: Server, page: Page, language: str) -> None:
    page.goto(f"{cell.url}/pages/cell")
    sized(page, 390, 844)
    shown = page.locator(".robot-state")
    for state in ("online", "unknown", "lost"):
        shown.evaluate(SAYS, [state, sentences(language)[f"state_{state}"], language])
        page.evaluate(DRAWN)
        assert settled(page, OVERFLOWS) == [], state


def test_the_frame_stays_where_it_is_when_the_page_scrolls(several: Server, page: Page) -> None:
    page.goto(several.url)
    for width, height in SCREENS:
        sized(page, width, height).evaluate(DRAWN)
        page.locator("main").evaluate("(main) => main.scrollTo(0, 0)")
        header = page.locator("header").bounding_box()
        page.locator("main").evaluate("(main) => main.scrollTo(0, main.scrollHeight)")
        assert page.locator("header").bounding_box() == header
        last = page.locator(".cell:visible").last
        expect(last).to_be_in_viewport()


def shown_groups(page: Page) -> list[str]:
    return [str(group.get_attribute("aria-label")) for group in page.locator(".group:visible").all()]


@pytest.mark.parametrize(
    ("width", "height", "at_first", "then"),
    [
        (1280, 800, ["Production", "Belt", "Cell"], None),
        (1024, 600, ["Production", "Belt"], ["Production", "Cell"]),
        (800, 1280, ["Production", "Belt"], ["Production", "Cell"]),
        (800, 480, ["Production"], ["Cell"]),
    ],
)
def test_groups_that_have_no_room_side_by_side_take_turns(
    cell: Server, page: Page, width: int, height: int, at_first: list[str], then: list[str] | None
) -> None:
    sized(page, width, height).goto(f"{cell.url}/pages/cell")
    expect(page.locator("#clock")).not_to_be_empty()
    assert shown_groups(page) == at_first
    tab = page.locator(".group-tab:visible", has_text="Cell")
    if then is None:
        expect(tab).to_have_count(0)
        return
    box = place(tab)
    assert min(box["width"], box["height"]) >= 44
    stop = button(page, "Stop").bounding_box()

    def is_shown() -> bool:  # as soon as the tabs' script is there
        tab.click()
        return tab.get_attribute("aria-pressed") == "true"

    until(is_shown, "its group is shown", every_s=0.2)
    assert shown_groups(page) == then
    assert button(page, "Stop").bounding_box() == stop
    assert settled(page, OVERFLOWS) == []


def test_without_scripts_all_groups_are_there(cell: Server, without_scripts: Page) -> None:
    without_scripts.goto(f"{cell.url}/pages/cell")
    for width, height in SCREENS[:4]:
        sized(without_scripts, width, height)
        assert shown_groups(without_scripts) == ["Production", "Belt", "Cell"]
        expect(without_scripts.locator(".group-tab:visible")).to_have_count(0)


@pytest.mark.parametrize(
    "path", ["alarms", "alarms/history", "alarms/report", "log", "diagnostics", "users"]
)
def test_a_phone_shows_the_pages_that_have_no_widgets(cell: Server, page: Page, path: str) -> None:
    sized(page, 390, 844).goto(f"{cell.url}/{path}")
    page.evaluate(DRAWN)
    assert page.locator("main .group").locator("visible=true").count() > 0
    assert page.evaluate("document.documentElement.scrollWidth") == 390
    assert page.locator("main").inner_text().strip()


@pytest.mark.parametrize("page_id", ["cell", "operation", "recipe", "robot", "watch"])
def test_what_a_phone_shows_has_room(cell: Server, page: Page, page_id: str) -> None:
    sized(page, 390, 844).goto(f"{cell.url}/pages/{page_id}")
    page.evaluate(DRAWN)
    assert squeezed(page) == []


def test_a_phone_only_shows(cell: Server, page: Page) -> None:
    sized(page, 390, 844).goto(f"{cell.url}/pages/cell")
    pressed = page.locator("form.page").locator("button, input").locator("visible=true")
    expect(pressed).to_have_count(1)  # Stop, in the lower left corner
    stop = place(pressed)
    assert stop["x"] < 10
    assert stop["y"] + stop["height"] > 844 - 10
    for widget in ("boxes", "permission", "speed"):
        expect(page.locator(f"[data-widget={widget}] .value")).to_be_visible()
    expect(page.get_by_text("View only")).to_be_visible()
    for link in page.locator(".pages a").all():
        expect(link.locator(".icon")).to_be_visible()
    page.get_by_role("button", name="Menu").click()
    page.get_by_role("button", name="Dark").click()
    expect(page.locator("html")).to_have_attribute("data-theme", "dark")


def test_frame_button_returns_to_the_page_where_it_was_pressed(
    cell: Server, page: Page, without_scripts: Page
) -> None:
    for shown in (page, without_scripts):
        shown.goto(f"{cell.url}/pages/setup")
        expect(button(shown, "Stop")).to_be_enabled()
        shown.wait_for_timeout(TAP_AGAIN_MS)
        button(shown, "Stop").click()
        expect(shown.locator("#receipt-stop")).to_have_attribute("data-outcome", "published")
        assert shown.url.partition("?")[0] == f"{cell.url}/pages/setup"
        expect(shown.locator("#receipt-stop")).to_be_visible()


@pytest.mark.parametrize("page_id", ["", "nothing", "../../log"])
def test_a_form_of_the_frame_that_names_no_page_goes_to_the_first(cell: Server, page_id: str) -> None:
    answer = cell.http.post("/widgets/stop", data={"_page": page_id})
    assert answer.status_code == 303
    assert answer.headers["location"].partition("?")[0] == "/pages/cell"


@pytest.mark.long(None)
def test_a_touch_on_a_locked_key_shows_its_whole_reason(long: Server, page: Page) -> None:
    sized(page, 1024, 600).goto(long.url)
    key, whole = page.locator("[data-widget=locked]"), page.locator("#whole")
    why = page.locator("#why-locked")
    expect(why).to_contain_text(DOORS)
    assert why.evaluate("(why) => why.scrollHeight > why.clientHeight")
    expect(key.locator(".more")).to_be_attached()  # its script is there
    key.click()
    expect(whole.get_by_role("heading", level=2)).to_have_text("Locked is locked")
    expect(whole.locator(".reason")).to_have_text(why.text_content() or "")
    assert whole.evaluate("(sheet) => sheet.scrollHeight <= sheet.clientHeight + 1")
    page.keyboard.press("Escape")
    expect(whole).to_be_hidden()


def test_a_keyboard_reaches_the_whole_reason(long: Server, page: Page) -> None:
    sized(page, 1024, 600).goto(long.url)
    more = page.locator("[data-widget=locked]").get_by_role("button", name="Show the whole text")
    expect(more).to_be_visible()
    more.press("Enter")
    expect(page.locator("#whole .reason")).to_contain_text(DOORS)


@pytest.mark.long(None)
def test_touching_a_buttons_result_shows_its_full_text_and_presses_nothing(
    long: Server, page: Page
) -> None:
    sized(page, 1024, 600).goto(long.url)
    key = page.locator("[data-widget=reset]")
    more = key.get_by_role("button", name="Show the whole text")
    expect(button(page, "Reset")).to_be_enabled()
    expect(more).to_be_hidden()
    button(page, "Reset").click()
    expect(key.locator(".result")).to_contain_text(LONG)
    answered = key.locator(".result").text_content() or ""
    more.click()
    expect(page.locator("#whole > p")).to_contain_text(LONG)
    assert key.locator(".result").text_content() == answered


def test_an_open_sheet_follows_its_key(long: Server, page: Page) -> None:
    """What is no longer so is not read on."""
    page.route("**/lock", lambda route: route.abort())
    sized(page, 1024, 600).goto(long.url)
    expect(page.locator("[data-widget=locked] .more")).to_be_attached()  # its script is there
    page.locator("[data-widget=locked]").click()
    expect(page.locator("#whole > p")).to_contain_text(DOORS)
    page.locator("#why-locked [data-text=reason]").evaluate(
        "(one) => { one.textContent = 'Another.'; }"
    )
    expect(page.locator("#whole > p")).to_have_text("Another.")
    page.locator("[data-widget=locked] > button:not(.more)").evaluate(
        "(one) => { one.disabled = false; }"
    )
    expect(page.locator("#whole")).to_be_hidden()


def test_keys_that_lock_at_once_are_measured_together(tmp_path: Path, page: Page) -> None:
    keys = (START.replace('"start"', f'"key{number}"') for number in range(KEYS))
    many = 'title = "Keys"\nmode = "demo"\n' + MAIN + "".join(keys)
    with demo_server(tmp_path, many) as mine:
        page.goto(mine.url)
        expect(page.locator(".key .more")).to_have_count(KEYS)  # its script is there
        clock = page.locator("#clock").text_content() or ""
        expect(page.locator("#clock")).not_to_have_text(clock)  # a beat: the snapshot is shown
        page.evaluate(DRAWN)
        session = page.context.new_cdp_session(page)
        session.send("Performance.enable")
        before = style_recalculations(session)
        page.evaluate(LOCK_ALL)
        page.evaluate(DRAWN)
        counted = style_recalculations(session) - before
        expect(page.locator(".key .more:visible")).to_have_count(KEYS)
    assert counted < KEYS / 2


def style_recalculations(session: CDPSession) -> float:
    """How often the browser has computed the page's styles."""
    metrics = session.send("Performance.getMetrics")["metrics"]
    return next(float(metric["value"]) for metric in metrics if metric["name"] == "RecalcStyleCount")


def test_the_menu_leads_to_the_log_and_changes_the_look(
    cell: Server, page: Page, without_scripts: Page
) -> None:
    for shown in (page, without_scripts):
        shown.goto(f"{cell.url}/pages/setup")
        menu, root = shown.locator("#menu"), shown.locator("html")
        for width, height in SCREENS[:4]:
            sized(shown, width, height)
            expect(menu).to_be_hidden()
            button(shown, "Menu").click()
            expect(menu).to_be_visible()
            for item in menu.locator("a:visible, button:visible").all():
                box = place(item)
                assert box["height"] >= 44
                assert box["x"] + box["width"] <= width
            shown.keyboard.press("Escape")
        button(shown, "Menu").click()
        button(shown, "Dark").click()
        expect(root).to_have_attribute("data-theme", "dark")
        assert shown.url == f"{cell.url}/pages/setup"
        button(shown, "Menu").click()
        expect(button(shown, "Dark")).to_have_attribute("aria-pressed", "true")
        shown.locator("nav.pages").get_by_role("link", name="Log").click()
        expect(shown.get_by_role("heading", name="Operator's log")).to_be_attached()
        expect(root).to_have_attribute("data-theme", "dark")


def test_the_tabs_change_sides(cell: Server, page: Page) -> None:
    sized(page, 1280, 800).goto(f"{cell.url}/pages/cell")
    tabs = page.locator("nav.pages")
    left = place(tabs)
    button(page, "Menu").click()
    button(page, "On the right").click()
    expect(page.locator("html[data-hand=left][data-floor]")).to_be_attached()  # its styles apply
    moved = place(tabs)
    assert left["x"] == 0
    assert moved["x"] + moved["width"] == 1280


def test_the_state_of_the_robot_is_a_word_in_the_header(cell: Server, page: Page) -> None:
    page.goto(f"{cell.url}/pages/setup")
    state = page.locator("#state")
    for enabled in (True, False):
        button = page.locator('[data-widget="load"] > button:not(.more)')
        expect(button).to_be_enabled(enabled=enabled, timeout=40_000)
        expect(state).to_have_text("ONLINE")  # what is permitted is no state of the robot
        expect(state.locator("svg:visible")).to_have_count(1)
    page.route("**/events*", lambda route: route.abort())
    page.reload()
    expect(state).to_have_text("no connection")
    expect(state).to_have_attribute("data-state", "lost")

"""The page as a machine's screen: cleaned, dark when it is not touched, and no browser's gestures."""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, Final

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.support.browser.pages import hold_by_key, middle
from tests.support.browser.touch import (
    HALT,
    HEARD,
    SIZES,
    loaded,
    opened,
    permit,
    settled,
    touched,
    touched_server,
)
from tests.support.parts import Server, until

pytestmark = [pytest.mark.long("detail"), pytest.mark.promise("fingers")]

DIM_S: Final = 1.0
# The order that the robot has heard, as the machine's state.
STATE: Final = """
[state]
topic = "/last_heard"
type = "std_msgs/msg/String"
states = [{ value = "4711 (/operation2)", text = "RUNNING", shape = "play" }]
"""
COUNTS: Final = """() => {
  window.arrived = [];
  for (const name of ["pointerdown", "touchstart", "mousedown", "click", "keydown"]) {
    document.addEventListener(name, () => arrived.push(name), true);
  }
}"""
# What lasts for a moment only leaves a sign on the element, or its texts, in `seen`.
BEGINS: Final = """(over, seconds) => {
  over.dataset.seconds = seconds;
  delete over.dataset.begun;
  over.addEventListener("beforetoggle", () => (over.dataset.begun = ""), { once: true });
}"""
WAKES: Final = """(dark) => {
  delete dark.dataset.woken;
  dark.addEventListener("beforetoggle", () => (dark.dataset.woken = ""), { once: true });
}"""
TEXTS: Final = """(timer) => {
  window.seen = [];
  new MutationObserver(() => seen.at(-1) !== timer.textContent && seen.push(timer.textContent))
    .observe(timer, { childList: true });
}"""


@pytest.fixture(scope="module")
def dimming(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    screen = f"dim_after_s = {DIM_S}\n{STATE}"
    with touched_server(tmp_path_factory.mktemp("dim"), screen=screen) as mine:
        yield mine


@pytest.fixture(scope="module")
def with_sounds(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with touched_server(tmp_path_factory.mktemp("sounds"), screen="sounds = true") as mine:
        yield mine


@pytest.fixture
def sleepy(touchscreen: Page, dimming: Server) -> Page:
    permit(dimming)
    return touched(touchscreen, dimming)


def presses(server: Server) -> int:
    """How many presses came from browsers."""
    return server.process.text.count(" by browser ")


def clean(page: Page, seconds: float) -> None:
    page.locator("#cleaning").evaluate(BEGINS, seconds)
    page.get_by_role("button", name="Menu").tap()
    page.get_by_role("button", name="Clean the screen").tap()
    expect(page.locator("#cleaning[data-begun]")).to_be_attached()


def wakes(page: Page, touch: Callable[[], Any]) -> None:
    """It is dark, and wakes from this."""
    expect(page.locator("#dark")).to_be_visible()
    page.locator("#dark").evaluate(WAKES)
    touch()
    expect(page.locator("#dark[data-woken]")).to_be_attached()


def unlocked(page: Page) -> None:
    """The lock is over, and what a second tap would have hit can be pressed."""
    expect(page.locator("#cleaning")).to_be_hidden()
    until(lambda: taps_arrive(page), "a tap arrives")


def taps_arrive(page: Page) -> bool:
    """A key of the page that presses nothing gets a tap."""
    page.evaluate(
        "window.got ??= (addEventListener('click', () => (window.taps = (window.taps ?? 0) + 1)), 1)"
    )
    before = page.evaluate("window.taps ?? 0")
    page.locator("#clock").dispatch_event("click")
    return bool(page.evaluate("window.taps ?? 0") > before)


def test_cleaning_lock_takes_thirty_seconds(screen: Page) -> None:
    screen.locator("#cleaning [role=timer]").evaluate(TEXTS)
    screen.get_by_role("button", name="Menu").tap()
    screen.get_by_role("button", name="Clean the screen").tap()
    until(lambda: screen.evaluate("seen.length") >= 2, "it counts")
    first, then = map(int, screen.evaluate("seen.slice(0, 2)"))
    assert first == 30
    assert 25 < then < 30  # a page that stood still leaves some out


@pytest.mark.long("every screen")
@pytest.mark.parametrize("size", SIZES, ids=lambda size: f"{size[0]}x{size[1]}")
def test_cleaning_shows_only_the_state_and_presses_nothing(
    touchscreen: Page, kiosk: Server, size: tuple[int, int]
) -> None:
    page = touched(touchscreen, kiosk, size)
    points = [
        middle(page.locator(selector))
        for selector in ("[data-widget=load] > [type=submit]", ".menu-key")
    ]
    before = presses(kiosk)
    clean(page, 30)
    page.evaluate(COUNTS)
    for x, y in points:
        page.touchscreen.tap(x, y)
        page.mouse.click(x, y)
    for key in ("Tab", "Enter", " ", "Escape", "F5"):
        page.keyboard.press(key)
    expect(page.locator("#cleaning")).to_be_visible()
    assert float(page.locator("#cleaning b").evaluate("(b) => b.offsetHeight")) >= 120
    expect(page.locator("#state")).to_be_in_viewport(ratio=1)
    x, y = middle(page.locator("#state"))
    inside = "([x, y]) => document.elementFromPoint(x, y).closest('#cleaning') === null"
    assert page.evaluate(inside, [x, y])
    expect(page.locator(".sheet")).to_have_count(0)
    expect(page.locator("#menu")).to_be_hidden()
    assert page.evaluate("arrived") == []
    permit(kiosk, HALT)
    permit(kiosk)
    assert presses(kiosk) == before


def test_cleaning_lock_ends_by_itself(screen: Page) -> None:
    clean(screen, 1)
    unlocked(screen)
    screen.get_by_role("button", name="Stop").tap()
    expect(screen.locator(HEARD)).to_have_text("stop (/operation)")


def test_cleaning_continues_after_a_reload(screen: Page) -> None:
    clean(screen, 30)
    screen.reload()
    expect(screen.locator("#cleaning")).to_be_visible()
    expect(screen.locator("[data-widget=jog] .hold")).to_be_disabled()


def test_cleaning_ends_a_hold(screen: Page) -> None:
    held = screen.locator("[data-widget=jog][data-hold]")
    hold_by_key(screen.locator(".hold"), held)
    # Without a second touch, which would end the hold too.
    screen.locator(".clean").evaluate("(key) => key.click()")
    expect(screen.locator("#cleaning")).to_be_visible()
    expect(held).to_have_count(0)
    screen.keyboard.up(" ")


def test_a_cloth_on_the_screen_at_its_end_presses_nothing(screen: Page, kiosk: Server) -> None:
    x, y = middle(screen.locator("[data-widget=load] > [type=submit]"))
    before = presses(kiosk)

    def wiped() -> bool:
        """Not where the cloth came too late: it slides off, and comes again."""
        clean(screen, 2)
        screen.mouse.move(x, y)
        screen.mouse.down()
        if not (locked := screen.locator("#cleaning").is_visible()):
            screen.mouse.move(0, 0)
        expect(screen.locator("#cleaning")).to_be_hidden()
        screen.mouse.up()
        unlocked(screen)
        return locked

    until(wiped, "a cloth is on the screen at its end")
    screen.get_by_role("button", name="Send order").tap()
    expect(screen.locator(HEARD)).to_have_text("4711 (/operation2)")
    until(lambda: presses(kiosk) > before, "its press is logged")
    assert presses(kiosk) == before + 1


@pytest.mark.long(None)
def test_waking_touch_on_a_dark_screen_presses_nothing(sleepy: Page, dimming: Server) -> None:
    before = presses(dimming)
    for selector in ("[data-widget=load] > [type=submit]", "#input-speed", ".hold"):
        wakes(sleepy, partial(sleepy.touchscreen.tap, *middle(sleepy.locator(selector))))
        expect(sleepy.locator("#dark")).to_be_visible()
        expect(sleepy.locator(".sheet")).to_have_count(0)
    wakes(sleepy, partial(sleepy.keyboard.press, " "))
    assert presses(dimming) == before
    assert "jog" not in dimming.process.text


def test_touch_after_cleaning_presses(sleepy: Page) -> None:
    load = middle(sleepy.locator("[data-widget=load] > [type=submit]"))
    before = sleepy.locator(HEARD).inner_text()
    wakes(sleepy, partial(sleepy.touchscreen.tap, *load))

    def pressed() -> bool:
        sleepy.touchscreen.tap(*load)
        return sleepy.locator(HEARD).inner_text() != before

    until(pressed, "a later touch presses", every_s=0.2)


def test_changed_state_wakes_the_screen(sleepy: Page, dimming: Server) -> None:
    wakes(sleepy, lambda: permit(dimming, HALT))
    permit(dimming)


def test_a_page_that_is_held_does_not_get_dark(sleepy: Page) -> None:
    x, y = middle(sleepy.locator("header"))
    tap = partial(sleepy.touchscreen.tap, x, y)
    wakes(sleepy, tap)
    dark = sleepy.locator("#dark")  # on a busy machine it is so again before a tap arrives
    until(lambda: tap() if dark.is_visible() else taps_arrive(sleepy), "a tap arrives")
    sleepy.mouse.move(x, y)
    sleepy.mouse.down()
    watched = """(ms) => new Promise((resolve) => {
      const dark = document.getElementById("dark");
      dark.addEventListener("beforetoggle", ({ newState }) => newState === "open" && resolve("dark"));
      setTimeout(() => resolve("light"), ms);
    })"""
    assert sleepy.evaluate(watched, 2500 * DIM_S) == "light"
    sleepy.mouse.up()
    expect(sleepy.locator("#dark")).to_be_visible()


def test_screen_without_dim_after_s_never_dims(screen: Page) -> None:
    expect(screen.locator("#dark")).to_have_count(0)


GESTURES: Final = """() => {
  const kept = (event, target = document.querySelector("main")) => target.dispatchEvent(event);
  const about = { bubbles: true, cancelable: true };
  const input = document.getElementById("input-note");
  const style = (element) => getComputedStyle(element);
  return {
    menu: kept(new MouseEvent("contextmenu", about)),
    inputMenu: kept(new MouseEvent("contextmenu", about), input),
    drag: kept(new DragEvent("dragstart", about), document.querySelector(".pages a")),
    zoomWheel: kept(new WheelEvent("wheel", { ...about, ctrlKey: true })),
    zoomKey: kept(new KeyboardEvent("keydown", { ...about, ctrlKey: true, key: "+" })),
    scroll: kept(new WheelEvent("wheel", about)),
    key: kept(new KeyboardEvent("keydown", { ...about, key: "+" })),
    select: style(document.querySelector("main h2")).userSelect !== "none",
    inputSelect: style(input).userSelect !== "none",
    pinch: style(document.querySelector("main")).touchAction !== "pan-x pan-y",
    overscroll: style(document.documentElement).overscrollBehaviorY !== "none",
  };
}"""
OWN: Final = {"scroll", "key", "inputSelect"}  # what a page on a machine keeps too


def test_a_touched_screen_has_none_of_the_browsers_gestures(screen: Page) -> None:
    gestures = screen.evaluate(GESTURES)
    assert {name for name, kept in gestures.items() if kept} == OWN
    assert screen.locator(".hold").evaluate("(key) => getComputedStyle(key).touchAction") == "none"


def test_a_developers_browser_keeps_them(page: Page, kiosk: Server) -> None:
    assert all(loaded(page, kiosk).evaluate(GESTURES).values())


def test_a_panel_may_leave_them(
    touchscreen: Page, servers: Callable[[Server], Server], tmp_path_factory: pytest.TempPathFactory
) -> None:
    server = servers(touched_server(tmp_path_factory.mktemp("panel"), screen="kiosk = false"))
    assert all(touched(touchscreen, server).evaluate(GESTURES).values())


TONES: Final = """
  window.tones = [];
  window.OscillatorNode = class extends OscillatorNode {
    constructor(context, about) { super(context, about); tones.push(about.frequency); }
  };
"""


def refused(page: Page) -> None:
    """Presses what the server refuses: a number is missing."""
    page.locator("#input-speed").evaluate("(input) => (input.value = '')")
    page.get_by_role("button", name="Load", exact=True).click()
    expect(page.locator("#receipt-load")).to_have_attribute("data-outcome", "refused")


def sent(page: Page) -> None:
    page.get_by_role("button", name="Stop").click()
    expect(page.locator(HEARD)).to_have_text("stop (/operation)")


def sounding(chromium: Browser, **cookies: str) -> Any:
    context = chromium.new_context()
    context.add_init_script(TONES)
    return context


def test_a_refused_press_sounds_low_and_no_other(chromium: Browser, with_sounds: Server) -> None:
    with opened(sounding(chromium), with_sounds) as page:
        page.locator("html[data-sound]").wait_for(state="attached")
        sent(page)
        assert page.evaluate("tones") == []
        refused(page)
        until(lambda: page.evaluate("tones.length"), "it sounds")
        assert page.evaluate("tones.length") == 1
        assert page.evaluate("tones[0]") < 400


def test_sounds_are_off_unless_the_panel_or_the_browser_says_so(
    chromium: Browser, kiosk: Server
) -> None:
    with opened(sounding(chromium), kiosk) as page:
        refused(page)
        assert page.evaluate("tones") == []
        page.get_by_role("button", name="Menu").click()
        page.get_by_role("group", name="Sound of a refused press").get_by_text("On").click()
        page.locator("html[data-sound]").wait_for(state="attached")
        refused(page)
        until(lambda: page.evaluate("tones.length"), "it sounds")


def test_a_browser_may_turn_the_panels_sounds_off(chromium: Browser, with_sounds: Server) -> None:
    context = sounding(chromium)
    context.add_cookies([{"name": "kiosk_sounds", "value": "off", "url": with_sounds.url}])
    with opened(context, with_sounds) as page:
        refused(page)
        assert page.evaluate("tones") == []
        settled(page)


def test_holds_stay_locked_after_cleaning_while_a_keypad_is_open(screen: Page) -> None:
    screen.locator("#input-speed").tap()
    expect(screen.locator(".sheet")).to_be_visible()
    clean(screen, 1)
    unlocked(screen)
    expect(screen.locator(".sheet")).to_be_visible()
    expect(screen.locator(".hold")).to_be_disabled()
    screen.locator(".cancel-entry").tap()
    expect(screen.locator(".hold")).to_be_enabled()

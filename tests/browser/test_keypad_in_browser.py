"""The keypad on the screen: numbers are entered beside their field, with gloves, within limits."""

import signal
from collections.abc import Callable
from pathlib import Path
from typing import Final

import pytest
from playwright.sync_api import Browser, Locator, Page, Route, expect

from tests.support.browser.pages import hold_by_key, place
from tests.support.browser.touch import (
    HALT,
    HEARD,
    HUMAN_S,
    MM_PER_PX,
    READER_S,
    SIZES,
    Keys,
    opened,
    overlap,
    permit,
    settled,
    touched,
    touched_server,
)
from tests.support.parts import Server, until
from tests.support.servers import demo_server

pytestmark = pytest.mark.promise("numbers")

JOYSTICK: Final = """
title = "Drive"
[[interlock]]
id = "operation"
topic = "/stick_enabled"
[[page]]
id = "one"
title = "One"
[[page.widget]]
id = "speed"
kind = "number"
label = "Speed"
min = 0
max = 100
[[page.widget]]
id = "stick"
interlock = "operation"
kind = "joystick"
label = "Drive"
topic = "/stick"
type = "geometry_msgs/msg/Twist"
y_axis = { max = 0.5, unit = "m/s" }
"""
FIELDS: Final = ("#input-speed", "[data-widget=height] output", "#input-belt", "#input-offset")


KEY_SIZES: Final = """(keys) => Object.fromEntries(keys.map((key) => {
  const { width, height } = key.getBoundingClientRect();
  return [key.dataset.key, [width, height]];
}))"""


# Whether a tap hits the key below the sheet, and whether it does so as the sheet closes.
NOTE_HIT: Final = """() => {
  window.hit = () => {
    const key = document.querySelector("[data-widget=load]");
    const { x, y, width, height } = key.getBoundingClientRect();
    return key.contains(document.elementFromPoint(x + width / 2, y + height / 2));
  };
  new MutationObserver(() => {
    const settles = "settling" in document.body.dataset && !document.querySelector(".sheet");
    if (settles) window.hitAtClose ??= hit();
  }).observe(document.body, { attributeFilter: ["data-settling"] });
}"""


def enter(page: Page, keys: str) -> None:
    for key in keys:
        page.locator(f'.sheet [data-key="{key}"]').tap()


def open_for(page: Page, field: str) -> Locator:
    page.locator(field).tap()
    expect(page.locator(".sheet")).to_be_visible()
    return page.locator(".sheet")


def test_touch_opens_the_keypad_with_name_value_limits_and_unit(screen: Page) -> None:
    sheet = open_for(screen, "#input-speed")
    expect(sheet.get_by_role("heading")).to_have_text("Jog speed (mm/s)")
    expect(sheet).to_have_attribute("aria-label", "Jog speed (mm/s)")
    expect(sheet.locator(".sheet-head p")).to_have_text("Now 120")
    expect(sheet.locator("output")).to_have_text("120")
    expect(sheet.locator("small")).to_have_text("mm/s")
    expect(sheet.locator(".low")).to_have_text("10")
    expect(sheet.locator(".high")).to_have_text("250")
    expect(screen.locator("#input-speed")).to_have_attribute("inputmode", "none")


def test_keypad_value_is_in_the_field_and_sent_by_a_press_only(screen: Page, kiosk: Server) -> None:
    sent: list[str] = []
    screen.on("request", lambda request: sent.append(request.url) if request.method == "POST" else None)
    open_for(screen, "#input-speed")
    enter(screen, "80")
    expect(screen.locator("#input-speed")).to_have_value("120")
    screen.locator(".set-entry").tap()
    expect(screen.locator("#input-speed")).to_have_value("80")
    expect(screen.locator(".sheet")).to_have_count(0)
    assert sent == []
    settled(screen)
    screen.get_by_role("button", name="Load", exact=True).tap()
    expect(screen.locator(HEARD)).to_have_text("4711 80 210.0 0.0 (/operation2)")


def test_value_outside_the_limits_stays_on_the_keypad_and_cannot_be_set(screen: Page) -> None:
    for keys, said, reason in (
        ("320", "Too high", "Outside the limits"),
        ("5", "Too low", "Outside the limits"),
        ("125", "Between two steps", "Between two steps"),
    ):
        sheet = open_for(screen, "#input-speed")
        enter(screen, keys)
        expect(sheet.locator("output")).to_have_text(keys)
        expect(sheet.locator(".entered p")).to_have_text(f"{said}10 to 250 mm/s, in steps of 10")
        expect(sheet.locator(".set-entry")).to_be_disabled()
        expect(sheet.locator(".why")).to_have_text(reason)
        expect(screen.locator("#input-speed")).to_have_value("120")
        screen.locator(".cancel-entry").tap()
        expect(screen.locator("#input-speed")).to_have_value("120")
        settled(screen)


def test_what_is_typed_before_it_is_there_is_kept_or_cancelled(
    touchscreen: Page, kiosk: Server
) -> None:
    late: list[Route] = []
    touchscreen.route("**/entry/key*.js", lambda route: late.append(route))
    page = touched(touchscreen, kiosk)
    for field, typed, shown in (
        ("#input-speed", "2", page.locator(".sheet output")),
        ("#input-note", "x", None),  # the keyboard types into its field
    ):
        entry = page.locator(field)
        before = entry.input_value()
        entry.tap()
        until(lambda: page.evaluate("1") and late, "its script is asked for")
        entry.select_text()
        page.keyboard.type(typed)
        expect(entry).to_have_value(typed)
        late.pop().continue_()
        expect(page.locator(".sheet")).to_be_visible()
        page.keyboard.type("5")
        if shown is not None:
            expect(shown).to_have_text(f"{typed}5")
        page.locator(".sheet .cancel-entry").tap()
        expect(entry).to_have_value(before)
        settled(page)


@pytest.mark.long("detail")
def test_empty_keypad_cannot_be_set(screen: Page) -> None:
    sheet = open_for(screen, "#input-speed")
    sheet.get_by_role("button", name="Clear").tap()
    expect(sheet.locator("output")).to_be_empty()
    expect(sheet.locator(".set-entry")).to_be_disabled()
    expect(sheet.locator(".why")).to_have_text("Enter a number")


def test_keypad_keys_edit_the_number(screen: Page) -> None:
    sheet = open_for(screen, "#input-offset")
    entered = sheet.locator("output")
    enter(screen, "2.255")
    expect(entered).to_have_text("2.255")
    sheet.get_by_role("button", name="Delete the last character").tap()
    expect(entered).to_have_text("2.25")
    sheet.get_by_role("button", name="Change the sign").tap()
    expect(entered).to_have_text("−2.25")
    screen.locator(".set-entry").tap()
    expect(screen.locator("#input-offset")).to_have_value("−2.25")
    settled(screen)
    open_for(screen, "#input-offset")
    screen.locator(".sheet [data-key=max]").tap()
    expect(entered).to_have_text("2.5")
    screen.locator(".sheet [data-key=min]").tap()
    expect(entered).to_have_text("−2.5")
    enter(screen, "1")
    expect(entered).to_have_text("1")  # in place of the limit


@pytest.mark.long("detail")
def test_keys_that_a_number_cannot_have_are_locked(screen: Page) -> None:
    sheet = open_for(screen, "#input-speed")
    for name in ("Change the sign", "Decimal point"):
        expect(sheet.get_by_role("button", name=name)).to_be_disabled()


@pytest.mark.long("detail")
def test_a_slider_takes_an_exact_value(screen: Page) -> None:
    open_for(screen, "[data-widget=height] output")
    enter(screen, "123.25")
    screen.locator(".set-entry").tap()
    expect(screen.locator("#input-height")).to_have_value("123.25")
    expect(screen.locator("[data-widget=height] output")).to_have_text("123.25")


@pytest.mark.long("detail")
def test_a_parameter_is_entered_and_then_set_by_its_own_key(screen: Page) -> None:
    sheet = open_for(screen, "#input-belt")
    expect(sheet.get_by_role("heading")).to_have_text("Belt speed")
    enter(screen, "900")
    expect(sheet.locator(".entered p")).to_contain_text("0 to 500 mm/s")  # as the node says
    sheet.get_by_role("button", name="Clear").tap()
    enter(screen, "250")
    sheet.get_by_role("button", name="Enter").tap()
    settled(screen)
    expect(screen.locator("#input-belt")).to_have_value("250")
    screen.get_by_role("button", name="Set Belt speed").tap()
    expect(screen.locator("[data-widget=belt] .value")).to_have_text("250 mm/s")


@pytest.mark.long("detail")
def test_a_parameter_follows_the_robot_after_cancel(screen: Page, kiosk: Server) -> None:
    """What was not kept is not entered."""
    first = screen.locator("#input-belt").input_value()
    open_for(screen, "#input-belt")
    screen.locator(".sheet [data-key=max]").tap()
    screen.locator(".cancel-entry").tap()
    expect(screen.locator("#input-belt")).to_have_value(first)
    kiosk.http.post("/widgets/belt", json={"inputs": {"belt": 70}})
    expect(screen.locator("#input-belt")).to_have_value("70")


@pytest.mark.long("every screen")
@pytest.mark.parametrize("size", SIZES, ids=lambda size: f"{size[0]}x{size[1]}")
def test_keypad_never_covers_its_field_stop_or_the_header(
    touchscreen: Page, kiosk: Server, size: tuple[int, int]
) -> None:
    page = touched(touchscreen, kiosk, size)
    for field in FIELDS:
        if not page.locator(field).is_visible():
            page.locator(".group-tab", has_text="Belt").first.tap()
        sheet = open_for(page, field)
        expect(page.locator(field)).to_be_in_viewport(ratio=1)
        for other in (field, ".frame-keys", "header"):
            assert not overlap(page, ".sheet", other), (field, other)
        assert not overlap(page, field, "header"), field
        box = place(sheet)
        assert box["x"] >= 0
        assert box["y"] >= 0
        assert box["x"] + box["width"] <= size[0]
        assert box["y"] + box["height"] <= size[1]
        sizes = sheet.locator("[data-key]").evaluate_all(KEY_SIZES)
        assert set(sizes) >= set("0123456789")
        assert all(min(sizes[key]) * MM_PER_PX > 13.9 for key in "0123456789"), (field, sizes)
        expect(sheet.locator(".set-entry")).to_be_in_viewport(ratio=1)
        page.locator(".cancel-entry").tap()
        settled(page)


@pytest.mark.long("detail")
def test_keypad_follows_its_field_when_the_screen_is_rotated(screen: Page) -> None:
    open_for(screen, "#input-offset")
    screen.set_viewport_size({"width": 800, "height": 1280})
    until(lambda: not overlap(screen, ".sheet", "#input-offset"), "it lies beside its field")
    expect(screen.locator(".sheet")).to_be_in_viewport(ratio=1)
    screen.set_viewport_size({"width": 800, "height": 1000})  # the field has the same size
    expect(screen.locator(".sheet")).to_be_in_viewport(ratio=1)


@pytest.mark.long("detail")
def test_a_page_that_was_lifted_lies_as_before(touchscreen: Page, kiosk: Server) -> None:
    page = touched(touchscreen, kiosk, (800, 480))
    before = page.locator("#input-speed").bounding_box()
    open_for(page, "#input-speed")
    page.locator(".cancel-entry").tap()
    until(lambda: page.locator("#input-speed").bounding_box() == before, "it is where it was")


def test_hold_buttons_are_locked_while_the_keypad_is_open(screen: Page) -> None:
    hold = screen.get_by_role("button", name="Left")
    expect(hold).to_be_enabled()
    open_for(screen, "#input-speed")
    expect(hold).to_be_disabled()
    expect(screen.locator("#why-jog")).to_have_text("The keypad is open. Close it first.")
    screen.locator(".cancel-entry").tap()
    expect(hold).to_be_enabled()
    expect(screen.locator("#why-jog")).to_have_text("")


@pytest.mark.long("detail")
def test_joysticks_are_locked_while_the_keypad_is_open(touch_page: Page, tmp_path: Path) -> None:
    with demo_server(tmp_path, JOYSTICK) as server:
        page = touched(touch_page, server)
        reason = page.locator("#why-stick")
        expect(reason).to_contain_text("operation")  # of the interlock
        open_for(page, "#input-speed")
        expect(reason).to_have_text("The keypad is open. Close it first.")
        page.locator(".cancel-entry").tap()
        expect(reason).to_contain_text("operation")
        page.goto("about:blank")  # the page would load itself again


def test_opening_the_keypad_ends_a_hold(screen: Page) -> None:
    held = screen.locator("[data-widget=jog][data-hold]")
    hold_by_key(screen.get_by_role("button", name="Left"), held)
    open_for(screen, "#input-speed")
    expect(held).to_have_count(0)
    screen.keyboard.up(" ")


def test_lock_during_an_open_keypad_shows_after_closing(screen: Page, kiosk: Server) -> None:
    open_for(screen, "#input-speed")
    permit(kiosk, HALT)
    expect(screen.locator('[data-widget="jog"] .hold')).to_be_disabled()
    screen.locator(".cancel-entry").tap()
    expect(screen.locator("#why-jog")).to_contain_text("order")
    expect(screen.get_by_role("button", name="Left")).to_be_disabled()


def test_page_cut_off_during_an_open_keypad_is_locked_after_closing(
    screen: Page, kiosk: Server
) -> None:
    open_for(screen, "#input-speed")
    kiosk.process.send(signal.SIGSTOP)
    try:
        expect(screen.locator("body[data-cut]")).to_be_attached()
        screen.locator(".cancel-entry").tap()
        expect(screen.locator(".sheet")).to_have_count(0)
        expect(screen.get_by_role("button", name="Left")).to_be_disabled()
        expect(screen.locator("#why-jog")).to_contain_text("server")
    finally:
        kiosk.process.send(signal.SIGCONT)


def test_stop_works_while_the_keypad_is_open(screen: Page) -> None:
    open_for(screen, "#input-speed")
    screen.get_by_role("button", name="Stop").tap()
    expect(screen.locator(HEARD)).to_have_text("stop (/operation)")
    expect(screen.locator(".sheet")).to_be_visible()


def test_a_second_tap_on_set_presses_nothing_below(screen: Page) -> None:
    open_for(screen, "#input-speed")
    screen.evaluate(NOTE_HIT)
    screen.locator(".set-entry").tap()
    screen.wait_for_function("() => window.hitAtClose !== undefined")
    assert screen.evaluate("hitAtClose") is False
    settled(screen)
    assert screen.evaluate("hit()")


@pytest.mark.long("detail")
def test_tapping_another_field_moves_the_keypad_and_discards_the_entry(screen: Page) -> None:
    open_for(screen, "#input-speed")
    enter(screen, "80")
    screen.locator("#input-order").tap()
    expect(screen.locator(".sheet.keyboard")).to_be_visible()
    expect(screen.locator(".sheet")).to_have_count(1)
    expect(screen.locator("#input-speed")).to_have_value("120")


def test_real_keyboard_types_into_the_keypad(screen: Page) -> None:
    sheet = open_for(screen, "#input-speed")
    Keys(screen, HUMAN_S).type("90")
    expect(sheet.locator("output")).to_have_text("90")
    expect(screen.locator("#input-speed")).to_have_value("120")
    screen.keyboard.press("Backspace")
    expect(sheet.locator("output")).to_have_text("9")
    screen.keyboard.press("Escape")
    expect(sheet).to_have_count(0)
    expect(screen.locator("#input-speed")).to_have_value("120")
    open_for(screen, "#input-speed")
    Keys(screen, HUMAN_S).type("90\n")
    expect(screen.locator("#input-speed")).to_have_value("90")


def test_a_bar_code_is_not_confirmed_as_a_number(screen: Page) -> None:
    sheet = open_for(screen, "#input-speed")
    Keys(screen, READER_S).type("90\n")
    expect(sheet.locator("output")).to_have_text("90")
    expect(sheet).to_be_visible()
    expect(screen.locator("#input-speed")).to_have_value("120")


@pytest.mark.long("detail")
def test_keypad_words_come_from_the_server(screen: Page) -> None:
    """The browser has a number, a unit and limits, and no word of its own."""
    served = screen.context.request.get(screen.url).text()
    open_for(screen, "#input-speed")
    enter(screen, "320")
    words = screen.locator(".sheet").evaluate(
        "(sheet) => [...sheet.querySelectorAll('*')].flatMap((one) => [...one.childNodes])"
        ".filter((one) => one.nodeType === 3).map((one) => one.data.trim())"
        ".filter((text) => /[a-z]{2}/i.test(text))"
    )
    assert len(words) > 8
    assert [word for word in words if word not in served] == []


@pytest.mark.long("every screen")
@pytest.mark.parametrize(
    ("keyboard", "has_touch", "opens"),
    [("auto", False, False), ("on", False, True), ("off", True, False), ("off", False, False)],
)
def test_panel_file_sets_where_the_keypad_opens(
    chromium: Browser,
    servers: Callable[[Server], Server],
    tmp_path_factory: pytest.TempPathFactory,
    keyboard: str,
    has_touch: bool,
    opens: bool,
) -> None:
    folder = tmp_path_factory.mktemp("panel")
    server = servers(touched_server(folder, f'keyboard = "{keyboard}"'))
    with opened(chromium.new_context(has_touch=has_touch), server) as page:
        page.locator("#input-speed").click()
        page.locator("#input-note").click()
        if opens:
            expect(page.locator(".sheet.keyboard")).to_be_visible()
            expect(page.locator("#input-speed")).to_have_attribute("inputmode", "none")
        else:
            page.keyboard.type("x")
            expect(page.locator("#input-note")).to_have_value("x")
            expect(page.locator(".sheet")).to_have_count(0)
            expect(page.locator("#input-note")).not_to_have_attribute("inputmode", "none")


@pytest.mark.long("detail")
def test_keypad_is_absent_without_scripts(chromium: Browser, kiosk: Server) -> None:
    context = chromium.new_context(java_script_enabled=False, has_touch=True)
    page = context.new_page()
    page.goto(kiosk.url)
    page.locator("#input-speed").tap()
    expect(page.locator("#input-speed")).not_to_have_attribute("inputmode", "none")
    expect(page.locator(".sheet")).to_have_count(0)
    expect(page.locator("button.clean")).to_be_hidden()
    context.close()

"""Text on a touched screen: the page's keyboard, a real one and a bar code reader."""

from typing import Final

import pytest
from playwright.sync_api import Locator, Page, expect

from tests.support.browser.touch import (
    HEARD,
    HUMAN_S,
    READER_S,
    SIZES,
    Keys,
    loaded,
    overlap,
    permit,
    settled,
    touched,
)
from tests.support.parts import Server

pytestmark = pytest.mark.promise("fingers")

FIELDS: Final = ("#input-order", "#input-note")
BOXES: Final = """(keys) => keys.map((key) => {
  const { width, height } = key.getBoundingClientRect();
  return [key.innerText, width, height];
})"""


@pytest.fixture
def desk(page: Page, kiosk: Server) -> Page:
    """A page with a mouse and a real keyboard."""
    permit(kiosk)
    expect(loaded(page, kiosk).locator("html[data-scans]")).to_be_attached()
    return page


def keyboard_for(page: Page, field: str) -> Locator:
    page.locator(field).tap()
    expect(page.locator(".sheet.keyboard")).to_be_visible()
    return page.locator(".sheet.keyboard")


def press(page: Page, *keys: str) -> None:
    for key in keys:
        page.locator(f'.keyboard [data-key="{key}"]').tap()


def test_letters_capitals_and_signs(screen: Page) -> None:
    keyboard_for(screen, "#input-note")
    press(screen, "a", "shift", "B", "c")
    expect(screen.locator("#input-note")).to_have_value("aBc")  # one capital
    press(screen, "shift", "shift", "D", "E", "shift", "f", " ", "7")
    press(screen, "signs", "€", "signs", "g")
    expect(screen.locator("#input-note")).to_have_value("aBcDEf 7€g")


@pytest.mark.long("detail")
def test_keyboard_edits_at_the_caret(screen: Page) -> None:
    keyboard_for(screen, "#input-note")
    press(screen, "a", "c", "left", "b")
    expect(screen.locator("#input-note")).to_have_value("abc")
    press(screen, "right", "d", "delete", "delete")
    expect(screen.locator("#input-note")).to_have_value("ab")
    expect(screen.locator("#input-note")).to_be_focused()
    screen.locator("#input-note").evaluate("(input) => input.setSelectionRange(0, 2)")
    press(screen, "x")
    expect(screen.locator("#input-note")).to_have_value("x")


@pytest.mark.long("detail")
def test_keyboard_accepts_no_more_characters_than_the_field(screen: Page) -> None:
    keyboard_for(screen, "#input-order")
    screen.locator("#input-order").evaluate("(input) => input.setSelectionRange(4, 4)")
    press(screen, *"12345678")
    expect(screen.locator("#input-order")).to_have_value("471112345678")
    expect(screen.locator('.keyboard [data-key="a"]')).to_be_disabled()
    press(screen, "delete")
    expect(screen.locator('.keyboard [data-key="a"]')).to_be_enabled()


def test_done_keeps_and_cancel_gives_back(screen: Page) -> None:
    changes = """() => {
      window.changes = [];
      document.addEventListener("change", ({ target }) => changes.push(target.value));
    }"""
    screen.evaluate(changes)
    keyboard_for(screen, "#input-note")
    press(screen, "a")
    screen.get_by_role("button", name="Done").tap()
    expect(screen.locator(".sheet")).to_have_count(0)
    expect(screen.locator("#input-note")).to_have_value("a")
    settled(screen)
    keyboard_for(screen, "#input-note")
    press(screen, "b", "c")
    screen.locator(".cancel-entry").tap()
    expect(screen.locator("#input-note")).to_have_value("a")
    assert screen.evaluate("changes") == ["a"]


def test_hold_buttons_are_locked_while_the_keyboard_is_open(screen: Page) -> None:
    keyboard_for(screen, "#input-note")
    expect(screen.locator("#why-jog")).to_have_text("The keyboard is open. Close it first.")
    expect(screen.locator(".hold")).to_be_disabled()


@pytest.mark.long("every screen")
@pytest.mark.parametrize("size", SIZES, ids=lambda size: f"{size[0]}x{size[1]}")
def test_keyboard_never_covers_its_field_stop_or_the_header(
    touchscreen: Page, kiosk: Server, size: tuple[int, int]
) -> None:
    page = touched(touchscreen, kiosk, size)
    for field in FIELDS:
        sheet = keyboard_for(page, field)
        expect(page.locator(field)).to_be_in_viewport(ratio=1)
        expect(sheet).to_be_in_viewport(ratio=1)
        for other in (field, ".frame-keys", "header"):
            assert not overlap(page, ".sheet", other), (field, other)
        assert not overlap(page, field, "header"), field
        boxes = page.locator(".keyboard button:visible").evaluate_all(BOXES)
        assert len(boxes) > 30
        assert [box for box in boxes if min(box[1:]) < 44] == [], field
        page.locator(".cancel-entry").tap()
        settled(page)


@pytest.mark.long("detail")
def test_german_has_its_own_letters(screen: Page) -> None:
    screen.evaluate("document.documentElement.lang = 'de-AT'")
    keyboard_for(screen, "#input-note")
    expect(screen.locator(".keyboard .row").nth(1)).to_have_text("qwertzuiopü")
    press(screen, "ö", "shift", "Ü", "ß")
    expect(screen.locator("#input-note")).to_have_value("öÜß")


def test_a_real_keyboard_types_into_the_field_and_its_enter_closes(screen: Page) -> None:
    keyboard_for(screen, "#input-note")
    press(screen, "a")
    Keys(screen, HUMAN_S).type("bc")
    press(screen, "d")
    expect(screen.locator("#input-note")).to_have_value("abcd")
    screen.keyboard.press("Enter")
    expect(screen.locator(".sheet")).to_have_count(0)
    expect(screen.locator("#input-note")).to_have_value("abcd")
    settled(screen)
    keyboard_for(screen, "#input-note")
    screen.keyboard.press("e")
    screen.keyboard.press("Escape")
    expect(screen.locator("#input-note")).to_have_value("abcd")


def test_enter_and_escape_that_end_a_conversion_close_nothing(screen: Page) -> None:
    sheet = keyboard_for(screen, "#input-note")
    input_method = screen.context.new_cdp_session(screen)
    reading = {"text": "せいばん", "selectionStart": 4, "selectionEnd": 4}
    for key in ("Escape", "Enter"):
        input_method.send("Input.imeSetComposition", reading)
        expect(screen.locator("#input-note")).to_have_value("せいばん")
        screen.keyboard.press(key)
        expect(sheet).to_be_visible()
    input_method.send("Input.insertText", {"text": "製番"})
    expect(screen.locator("#input-note")).to_have_value("製番")
    screen.keyboard.press("Enter")
    expect(screen.locator(".sheet")).to_have_count(0)


@pytest.mark.long("real time")
def test_bar_code_replaces_the_value_of_its_field(desk: Page) -> None:
    Keys(desk, READER_S).type("AB 12-3\n")
    expect(desk.locator("#input-order")).to_have_value("AB 12-3")
    Keys(desk, READER_S).type("999\n")
    expect(desk.locator("#input-order")).to_have_value("999")
    expect(desk.locator("#input-order")).not_to_be_focused()


@pytest.mark.parametrize("code", ["9", "99"])
def test_an_enter_as_near_as_the_last_keys_of_a_hand_ends_a_text(screen: Page, code: str) -> None:
    keyboard_for(screen, "#input-note")
    keys = Keys(screen, HUMAN_S)
    keys.type(f"12{code[0]}")
    keys.type(f"{code[1:]}\n", READER_S)
    expect(screen.locator(".sheet")).to_have_count(0)
    expect(screen.locator("#input-note")).to_have_value(f"12{code}")


@pytest.mark.long("detail")
def test_a_bar_code_into_the_field_itself_replaces_too(desk: Page) -> None:
    desk.locator("#input-order").click()
    Keys(desk, READER_S).type("999\n")
    expect(desk.locator("#input-order")).to_have_value("999")


@pytest.mark.long("detail")
def test_a_bar_code_stays_in_another_field_that_is_focused(desk: Page) -> None:
    desk.locator("#input-note").click()
    Keys(desk, READER_S).type("999\n")
    expect(desk.locator("#input-note")).to_have_value("999")
    expect(desk.locator("#input-order")).to_have_value("4711")


@pytest.mark.long("real time")
def test_a_code_that_is_too_long_is_not_cut(desk: Page) -> None:
    Keys(desk, READER_S).type("1234567890123\n")
    text = "The bar code has more than 12 characters. Nothing was entered."
    expect(desk.locator("#scan-order")).to_have_text(text)
    expect(desk.locator("#input-order")).to_have_value("4711")
    Keys(desk, READER_S).type("12345\n")
    expect(desk.locator("#scan-order")).to_be_empty()


@pytest.mark.long("real time")
def test_typing_by_hand_is_not_taken_for_a_bar_code(desk: Page) -> None:
    Keys(desk, HUMAN_S).type("999\n")
    Keys(desk, READER_S).type("88\n")  # two keys together
    expect(desk.locator("#input-order")).to_have_value("4711")
    Keys(desk, READER_S).type("777\n")
    expect(desk.locator("#input-order")).to_have_value("777")


@pytest.mark.long("real time")
@pytest.mark.parametrize("apart_s", [READER_S, HUMAN_S])
def test_bar_code_reader_does_not_press_the_focused_button(
    desk: Page, kiosk: Server, apart_s: float
) -> None:
    """Neither its Enter nor, of a fast one, a space in its code: a pressed key keeps the focus."""
    posts: list[str] = []
    desk.on("websocket", lambda socket: socket.on("framesent", lambda sent: posts.append(str(sent))))
    key = desk.locator("[data-widget=send] > [type=submit]")
    key.focus()
    Keys(desk, apart_s).type("12 34\n" if apart_s == READER_S else "1234\n")
    desk.locator("#input-order").fill("after")
    desk.keyboard.press("Enter")  # in the field: nothing either
    desk.get_by_role("button", name="Stop").click()
    expect(desk.locator(HEARD)).to_have_text("stop (/operation)")
    assert kiosk.process.count("press ") >= 1
    assert "of send by browser" not in kiosk.process.text


def test_space_still_presses_a_key_that_has_the_focus(desk: Page) -> None:
    desk.get_by_role("button", name="Stop").focus()
    desk.keyboard.press(" ")
    expect(desk.locator(HEARD)).to_have_text("stop (/operation)")

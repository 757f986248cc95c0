"""A person confirms a press at the screen: with a finger on the pad, by keyboard, with a badge."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Locator, Page, expect

from tests.support.browser.pages import place, press_button, widget
from tests.support.confirmed import PANEL, PINS, add_users
from tests.support.parts import Server, until
from tests.support.servers import demo_server
from tests.support.users import says

SIZES = ((1280, 800), (1024, 600), (800, 480))


@pytest.fixture(scope="module")
def kiosk(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    data = tmp_path_factory.mktemp("data")
    add_users(data)
    with demo_server(tmp_path_factory.mktemp("panel"), PANEL, KIOSK_DATA=str(data)) as mine:
        until(lambda: mine.snapshot()["interlocks"]["operation"]["enabled"], "the robot permits")
        yield mine


def opened(page: Page, server: Server, user: str, language: str = "en") -> None:
    """The panel's page, where this user is signed in."""
    page.set_extra_http_headers({"accept-language": language})
    page.goto(server.url)
    page.evaluate(
        """(body) => fetch("/session", {
          method: "POST", headers: { "content-type": "application/json" }, body: JSON.stringify(body),
        })""",
        {"user": user, "pin": PINS[user]},
    )
    page.goto(server.url)
    expect(page.locator("a.user")).to_have_attribute("data-user", user)


def sheet_of(page: Page, name: str, nth: int = 0) -> Locator:
    """The sheet that a button opens, when it takes an answer."""
    button = press_button(page, name).nth(nth)
    expect(button).to_be_enabled()
    button.click()
    sheet = page.locator("#person")
    expect(sheet).to_be_visible()
    expect(sheet.locator(".yes")).to_be_enabled()
    return sheet


def typed(sheet: Locator, pin: str) -> None:
    for digit in pin:
        sheet.locator(f".pad button[value='{digit}']").click()


def touches(first: Locator, second: Locator) -> bool:
    a, b = place(first), place(second)
    beside = a["x"] + a["width"] <= b["x"] or b["x"] + b["width"] <= a["x"]
    return not (beside or a["y"] + a["height"] <= b["y"] or b["y"] + b["height"] <= a["y"])


@pytest.mark.long("every screen")
@pytest.mark.parametrize("size", SIZES)
def test_a_wrong_pin_says_so_and_the_right_one_presses(
    own_page: Page, kiosk: Server, size: tuple[int, int]
) -> None:
    page = own_page
    page.set_viewport_size({"width": size[0], "height": size[1]})
    opened(page, kiosk, "M. Sato")
    sheet = sheet_of(page, "start")
    expect(sheet.locator("h2")).to_have_text("Your PIN again, M. Sato")
    expect(sheet.locator(".consequence")).to_have_text("The oven heats up.")
    expect(sheet.locator("dd")).to_have_text("200")
    assert not touches(sheet, press_button(page, "halt"))
    typed(sheet, "2581")
    sheet.locator(".yes").click()
    expect(sheet.locator(".said")).to_contain_text("The PIN is wrong. Tries left:")
    expect(sheet.locator("input[name=_pin]")).to_have_value("")
    typed(sheet, "2580")
    sheet.locator(".yes").click()
    expect(sheet).to_be_hidden()
    receipt = widget(page, "start").locator(".receipt")
    expect(receipt).to_contain_text("Confirmed by M. Sato with the PIN.")
    assert not says(page.content(), "2580")


@pytest.mark.long("every screen")
@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("language", ["en", "de", "ja"])
def test_the_sheet_is_whole_on_the_screen_in_every_language(
    own_page: Page, kiosk: Server, size: tuple[int, int], language: str
) -> None:
    page = own_page
    page.set_viewport_size({"width": size[0], "height": size[1]})
    opened(page, kiosk, "K. Novak", language)
    for name in ("bypass", "start"):
        sheet = sheet_of(page, name)
        for part in sheet.locator("button, input, select, h2, .sentence").all():
            box = place(part)
            assert box["x"] >= 0
            assert box["y"] >= 0
            assert box["x"] + box["width"] <= size[0]
            assert box["y"] + box["height"] <= size[1]
        for button in sheet.locator(".pad button, .yes, .close").all():
            assert min(place(button)["width"], place(button)["height"]) >= 44
        assert not touches(sheet, press_button(page, "halt"))
        assert sheet.evaluate("(sheet) => sheet.scrollHeight <= sheet.clientHeight + 1")
        sheet.locator(".close").click()
        expect(sheet).to_be_hidden()
        expect(page.locator("body")).not_to_have_attribute("data-asks", "")


def test_stop_works_while_the_sheet_is_open(own_page: Page, kiosk: Server) -> None:
    page = own_page
    opened(page, kiosk, "M. Sato")
    sheet_of(page, "start")
    press_button(page, "halt").click()
    expect(widget(page, "halt").locator(".receipt")).to_have_attribute("data-outcome", "published")


def test_a_keyboard_is_enough(own_page: Page, kiosk: Server) -> None:
    page = own_page
    opened(page, kiosk, "M. Sato")
    button = press_button(page, "start")
    expect(button).to_be_enabled()
    button.focus()
    page.keyboard.press("Enter")
    sheet = page.locator("#person")
    expect(sheet.locator(".yes")).to_be_enabled()
    expect(sheet.locator("input[name=_pin]")).to_be_focused()
    page.keyboard.type("2580", delay=80)
    page.keyboard.press("Enter")
    expect(widget(page, "start").locator(".receipt")).to_contain_text("with the PIN.")
    expect(button).to_be_focused()
    page.keyboard.press("Enter")
    expect(sheet.locator(".yes")).to_be_enabled()
    page.keyboard.press("Escape")
    expect(sheet).to_be_hidden()


@pytest.mark.long("detail")
def test_a_badge_reader_types_into_the_field_of_the_pin(own_page: Page, kiosk: Server) -> None:
    page = own_page
    opened(page, kiosk, "M. Sato")
    sheet = sheet_of(page, "start")
    expect(sheet.locator("input[name=_pin]")).to_be_focused()
    page.evaluate(
        """(badge) => {
          const field = document.querySelector("#person input[name=_pin]");
          for (const sign of badge) {
            field.value += sign;
            field.dispatchEvent(new InputEvent("input", { bubbles: true }));
          }
        }""",
        "04A2B3C4",
    )
    page.keyboard.press("Enter")
    expect(widget(page, "start").locator(".receipt")).to_contain_text("with the badge.")
    assert "04A2B3C4" not in page.content()


@pytest.mark.long("detail")
def test_a_second_person_is_chosen_and_both_are_named(own_page: Page, kiosk: Server) -> None:
    page = own_page
    opened(page, kiosk, "K. Novak")
    sheet = sheet_of(page, "bypass")
    assert sheet.locator("option").all_text_contents() == ["", "J. Brandt", "L. Rossi"]
    sheet.locator("select").select_option("J. Brandt")
    typed(sheet, "3691")
    sheet.locator(".yes").click()
    expect(widget(page, "bypass").locator(".result")).to_have_attribute("data-outcome", "succeeded")
    page.goto(f"{kiosk.url}/log?widget=bypass")
    expect(page.locator("td", has_text="Confirmed by K. Novak and J. Brandt (PIN).")).to_be_visible()


@pytest.mark.long("detail")
def test_each_position_of_a_switch_has_its_word_on_the_sheet(own_page: Page, kiosk: Server) -> None:
    page = own_page
    opened(page, kiosk, "M. Sato")
    sheet = sheet_of(page, "light", 1)
    word = press_button(page, "light").nth(1).text_content()
    expect(sheet.locator(".yes")).to_have_text(f"{word}")
    typed(sheet, "2580")
    sheet.locator(".yes").click()
    expect(widget(page, "light")).to_have_attribute("data-at", "on")


def test_a_hold_is_confirmed_before_it_begins(own_page: Page, kiosk: Server) -> None:
    page = own_page
    opened(page, kiosk, "M. Sato")
    sheet = sheet_of(page, "jog")
    expect(sheet.locator(".yes")).to_have_text("Confirm")
    typed(sheet, "2580")
    sheet.locator(".yes").click()
    expect(sheet).to_be_hidden()
    root = widget(page, "jog")
    expect(root.locator(".receipt")).to_contain_text("Hold the button within 30 s")
    expect(page.locator("body")).not_to_have_attribute("data-asks", "")
    box = place(press_button(page, "jog"))
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.down()
    expect(root).to_have_attribute("data-hold", "held")
    page.mouse.up()
    expect(root.locator(".receipt")).to_contain_text("Confirmed by M. Sato with the PIN.")
    sheet_of(page, "jog")  # the next hold needs the next PIN

"""A bar code or badge reader is a keyboard that types faster than a hand.

Whatever has the focus, its keys press, hold and choose nothing, and its code goes to the field that
asks for it, or is said not to be asked for.
"""

from collections.abc import Iterator
from typing import Any, Final

import pytest
from playwright.sync_api import Page, expect

from tests.support.browser.browsers import sized
from tests.support.browser.pages import place
from tests.support.browser.touch import loaded
from tests.support.parts import Server, until
from tests.support.servers import demo_server

pytestmark = [pytest.mark.long("real time"), pytest.mark.promise("fingers")]

READER_S: Final = 0.005
HUMAN_S: Final = 0.2
CODE: Final = "AB 12-3"
KINDS: Final = """
[[page.widget]]
id = "go"
kind = "publish"
label = "Go"
topic = "/operation1"
type = "std_msgs/msg/String"
message = { data = "go" }

[[page.widget]]
id = "asked"
kind = "publish"
label = "Asked"
confirm_press = true
topic = "/operation1"
type = "std_msgs/msg/String"
message = { data = "asked" }

[[page.widget]]
id = "jog"
kind = "hold"
label = "Jog"
topic = "/operation1"
type = "std_msgs/msg/String"
message = { data = "left" }
release = { data = "stopped" }
interlock = "operation"

[[page.widget]]
id = "drive"
kind = "joystick"
label = "Drive"
topic = "/stick"
type = "geometry_msgs/msg/Twist"
interlock = "operation"
y_axis = { max = 0.5 }

[[page.widget]]
id = "speed"
kind = "number"
label = "Speed"
min = 0
max = 9999999
default = 5

[[page.widget]]
id = "height"
kind = "slider"
label = "Height"
min = 0
max = 100
default = 50

[[page.widget]]
id = "light"
kind = "toggle"
label = "Light"

[[page.widget]]
id = "program"
kind = "select"
label = "Program"
options = [{ value = "x", label = "x" }, { value = "a", label = "a" }, { value = "1", label = "1" }]
"""
PANEL: Final = f"""
title = "Cell"
mode = "demo"
[[interlock]]
id = "operation"
topic = "/last_heard"
type = "std_msgs/msg/String"
field = "data"
not_equals = "halt"
[[frame.widget]]
id = "stop"
kind = "publish"
role = "stop"
label = "Stop"
topic = "/operation"
type = "std_msgs/msg/String"
message = {{ data = "stop" }}
[[page]]
id = "plain"
title = "Plain"
{KINDS}
[[page]]
id = "asks"
title = "Asks"
{KINDS.replace('id = "', 'id = "s')}
[[page.widget]]
id = "order"
kind = "text"
label = "Order"
max_length = 12
scan = true
"""
# What may have the focus: its selector, with the widget's id on the plain page.
TARGETS: Final = {
    "nothing": "",
    "a press": '[data-widget="{}go"] > button',
    "a press that asks": '[data-widget="{}asked"] > button',
    "a hold": '[data-widget="{}jog"] button.hold',
    "a joystick": '[data-widget="{}drive"] button.hold',
    "a number": '[data-widget="{}speed"] input',
    "a step of a number": '[data-widget="{}speed"] button.step',
    "a slider": '[data-widget="{}height"] input[type=range]',
    "a toggle": '[data-widget="{}light"] input[type=checkbox]',
    "a select": '[data-widget="{}program"] select',
    "stop": "[data-widget=stop] > button",
    "a tab": "nav.pages a >> nth=1",
    "the menu": ".menu-key",
    "the links": ".lamps",
}
# How a reader's code begins and ends.
FORMS: Final = {
    "Enter": ("", "\n"),
    "Tab": ("", "\t"),
    "CR LF": ("", "\n\n"),
    "control characters": ("", "\n^"),
    "a prefix": ("~", "\n"),
    "a space before": (" ", "\n"),
    "Enter before": ("\n", "\n"),
    "nothing": ("", ""),
}


class Reader:
    """A reader, or a hand, at the keyboard: "\\n" is Enter, "\\t" Tab, "^" Ctrl+J."""

    def __init__(self, page: Page, apart_s: float = READER_S) -> None:
        self._session = page.context.new_cdp_session(page)
        self._apart_s = apart_s
        self._now = float(page.evaluate("performance.timeOrigin + performance.now()")) / 1000

    def type(self, text: str) -> None:
        for character in text:
            self.key(**about(character))

    def key(self, **key: Any) -> None:
        self._now += self._apart_s
        for kind in ("keyDown", "keyUp"):
            up = {} if kind == "keyDown" else {"text": ""}
            self._session.send(
                "Input.dispatchKeyEvent", {"type": kind, "timestamp": self._now, **key, **up}
            )


def about(character: str) -> dict[str, Any]:
    named = {"\n": ("Enter", 13, "\r"), "\t": ("Tab", 9, "")}
    if character in named:
        name, number, text = named[character]
        return {"key": name, "code": name, "windowsVirtualKeyCode": number, "text": text}
    if character == "^":
        return {"key": "j", "code": "KeyJ", "windowsVirtualKeyCode": 74, "modifiers": 2}
    code = "Space" if character == " " else f"Key{character.upper()}"
    number = ord(character.upper())
    return {"key": character, "code": code, "text": character, "windowsVirtualKeyCode": number}


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with demo_server(tmp_path_factory.mktemp("cell"), PANEL) as server:
        server.http.post("/widgets/stop", json={"inputs": {}})  # it says what it has heard
        until(lambda: server.widget("jog")["enabled"], "the robot permits")
        yield server


def opened(page: Page, cell: Server, name: str) -> Page:
    loaded(sized(page, 1280, 800), cell, f"/pages/{name}")
    expect(page.locator("[data-widget$=go] > button")).to_be_enabled()
    page.evaluate("performance.mark('opened')")
    return page


def state(page: Page) -> dict[str, Any]:
    """All that a key may change."""
    shown: dict[str, Any] = page.evaluate(
        """() => ({
          values: [...document.querySelectorAll("main :is(input, select)")]
            .filter((input) => !input.matches("[data-scan]"))
            .map((input) => [input.name, input.value, input.checked]),
          held: document.querySelectorAll("[data-hold]").length,
          open: document.querySelectorAll(":popover-open").length,
          busy: [...document.querySelectorAll("[aria-busy]")].map((busy) => busy.outerHTML),
          focused: document.activeElement.tagName + document.activeElement.className
            + (document.activeElement.closest("[data-widget]")?.dataset.widget ?? ""),
          at: location.href,
        })"""
    )
    return shown


def presses(server: Server) -> int:
    return server.process.text.count("]: press ") + server.process.text.count(" begins")


def settled(page: Page) -> None:
    """A key that is not known to have come alone yet would act by now."""
    page.evaluate("() => new Promise((resolve) => setTimeout(resolve, 150))")


def scanned(page: Page, cell: Server, selector: str, text: str) -> None:
    """A reader types this while an element has the focus, and nothing happens to it."""
    if selector:
        page.locator(selector).first.focus()
    page.evaluate("() => (document.querySelector('.page-report').hidden = true)")
    before, sent = state(page), presses(cell)
    Reader(page).type(text)
    settled(page)
    assert state(page) == before, repr(text)
    assert presses(cell) == sent, repr(text)


@pytest.mark.parametrize("target", TARGETS)
def test_a_code_acts_on_nothing_that_has_the_focus(page: Page, cell: Server, target: str) -> None:
    opened(page, cell, "plain")
    for form, (prefix, suffix) in FORMS.items():
        if target == "a number" and form == "nothing":
            continue  # without an end it is a number that is typed, shown and judged at the press
        scanned(page, cell, TARGETS[target].format(""), prefix + CODE + suffix)
        expect(page.locator(".page-report"), form).to_be_visible()


@pytest.mark.parametrize("target", TARGETS)
def test_a_code_goes_to_the_field_that_asks_for_it(page: Page, cell: Server, target: str) -> None:
    opened(page, cell, "asks")
    for number, (form, (prefix, suffix)) in enumerate(FORMS.items()):
        if prefix or (target == "a number" and form == "nothing"):
            continue
        scanned(page, cell, TARGETS[target].format("s"), f"{CODE}{number}{suffix}")
        expect(page.locator("#input-order"), form).to_have_value(f"{CODE}{number}")
        expect(page.locator(".page-report")).to_be_hidden()


def test_the_layout_of_the_machine_makes_no_key_a_hands(page: Page, cell: Server) -> None:
    """A German layout has a key that waits for a letter, where the reader sends a sign."""
    opened(page, cell, "asks")
    page.locator(TARGETS["a press"].format("s")).focus()
    before, sent, reader = state(page), presses(cell), Reader(page)
    reader.type("z")
    reader.key(key="Dead", code="Backquote")
    reader.type("12\n")
    settled(page)
    assert state(page) == before
    assert presses(cell) == sent


def test_caps_lock_does_not_change_a_code(own_page: Page, cell: Server) -> None:
    own_page.add_init_script("KeyboardEvent.prototype.getModifierState = (name) => name === 'CapsLock'")
    opened(own_page, cell, "asks")
    Reader(own_page).type("ab12Cd\n")
    expect(own_page.locator("#input-order")).to_have_value("AB12cD")


@pytest.mark.parametrize("key", ["\n", " "])
def test_a_touched_button_does_not_keep_the_focus(page: Page, cell: Server, key: str) -> None:
    opened(page, cell, "plain")
    page.locator(TARGETS["a press"].format("")).click()
    expect(page.locator("[data-widget=go] .receipt")).not_to_be_empty()
    expect(page.locator("[data-widget=go] > button:not([aria-busy])")).to_be_attached()
    sent = presses(cell)
    Reader(page, HUMAN_S).type(key)
    settled(page)
    assert presses(cell) == sent


@pytest.mark.parametrize("key", ["\n", " "])
def test_a_hand_at_the_keyboard_still_presses(page: Page, cell: Server, key: str) -> None:
    opened(page, cell, "plain")
    sent = presses(cell)
    page.locator(TARGETS["a press"].format("")).focus()
    Reader(page, HUMAN_S).type(key)
    until(lambda: presses(cell) > sent, "it is pressed")
    page.locator(TARGETS["a toggle"].format("")).focus()
    Reader(page, HUMAN_S).type(" ")
    expect(page.locator(TARGETS["a toggle"].format(""))).to_be_checked()
    assert place(page.locator("[data-widget=go]"))

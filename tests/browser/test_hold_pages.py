"""What a page shows of a hold, with a finger or a key on it: on a server whose leases a busy machine
keeps. `test_holds_in_browser.py` has the ends of holds, and measures them."""

from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
from typing import Final

import pytest
from playwright.sync_api import Browser, Page, Route, expect

from tests.support.browser.finger import Finger, jogged
from tests.support.holds import PATIENT, TOPIC, TRIES, codes, ended, has_ended, jogging
from tests.support.parts import Bridge, RosNode, Server, has_heard, until

pytestmark = pytest.mark.promise("hold")

# A network on which each message takes 45 ms.
SLOW: Final = """
    window.WebSocket = class extends WebSocket {
      set onmessage(hear) { super.onmessage = (event) => setTimeout(() => hear(event), 45); }
      set onclose(hear) { super.onclose = (event) => setTimeout(() => hear(event), 45); }
      send(text) { setTimeout(() => this.readyState === WebSocket.OPEN && super.send(text), 45); }
    };
"""
RECEIPT_S: Final = 10.0  # a page that hears nothing of its hold says so itself, and sooner


@pytest.fixture(scope="module")
def kiosk(
    bridge: Bridge, jogger: RosNode, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Server]:
    mine = jogging(bridge, jogger, tmp_path_factory.mktemp("jog"), PATIENT)
    yield mine
    mine.end()


def any_of(*conditions: Callable[[], object]) -> bool:
    return any(condition() for condition in conditions)


def no_longer_held(server: Server) -> None:
    until(lambda: not server.widget("jog")["held"], "no longer held")


def ends_before(finger: Finger) -> int:
    """How many holds had ended before the next one, which can begin."""
    expect(finger.button).to_be_enabled()
    no_longer_held(finger.server)
    return len(codes(finger.server))


@pytest.mark.long("every screen")
@pytest.mark.parametrize("tap_ms", [0, 30, 80, 130, 190, 400])
def test_a_tap_over_a_slow_way_has_its_receipt(
    chromium: Browser, kiosk: Server, jogger: RosNode, tap_ms: int
) -> None:
    """However the finger's lifting meets the server's answers: 45 ms each way."""
    context = chromium.new_context(has_touch=True)
    context.add_init_script(SLOW)
    finger = Finger(context.new_page(), kiosk)
    for _ in range(TRIES):
        ends = ends_before(finger)
        finger.down()
        finger.page.wait_for_timeout(tap_ms)
        finger.up()
        receipt = finger.page.locator("#receipt-jog")
        with suppress(AssertionError):  # it was locked as the finger came
            expect(receipt).not_to_be_empty(timeout=1000 * RECEIPT_S)
        said = receipt.inner_text()
        if "Released at" in said or "released before the hold began" in said:
            break  # else the machine stood still
    else:
        raise AssertionError(said)
    no_longer_held(kiosk)
    assert codes(kiosk, ends) in ([], ["hold_released"])
    context.close()


def test_a_key_that_is_held_is_a_hold_and_its_repeats_are_none(finger: Finger, jogger: RosNode) -> None:
    receipt = finger.page.locator("#receipt-jog")
    for _ in range(TRIES):
        ends, before = ends_before(finger), len(jogger.heard(TOPIC))
        finger.button.focus()
        finger.page.keyboard.down(" ")
        for _ in range(5):
            finger.page.keyboard.down(" ")  # what a keyboard repeats
        moves = partial(has_heard, jogger, TOPIC, before + 5)
        with suppress(AssertionError):  # it was locked as the key came
            either = partial(any_of, moves, receipt.inner_text)
            until(either, "it moves, or the machine stood still", within_s=RECEIPT_S)
        finger.page.keyboard.up(" ")
        if not moves():
            continue
        until(partial(has_ended, finger.server, ends), "it ends")
        if codes(finger.server)[ends] == "hold_released":
            return
    raise AssertionError(ended(finger.server))


def test_another_browser_sees_the_hold_and_is_refused(
    finger: Finger, chromium: Browser, jogger: RosNode
) -> None:
    context = chromium.new_context(has_touch=True)
    other = Finger(context.new_page(), finger.server)
    holding = other.page.locator('[data-widget="jog"] .holding')
    said = other.page.locator("#receipt-jog")
    for _ in range(TRIES):
        _, ends = jogged(finger, jogger)
        with suppress(AssertionError):  # it ended before that could be seen
            expect(holding).to_contain_text("Held since")
            other.down()
            expect(said).not_to_be_empty()
        other.up()
        finger.up()
        until(partial(has_ended, finger.server, ends), "it ends")
        if codes(finger.server)[ends] == "hold_released":
            break
    expect(said).to_contain_text("held by another browser")
    expect(holding).to_have_text("")
    context.close()


def test_hold_without_scripts_is_locked_with_a_reason(without_scripts: Page, kiosk: Server) -> None:
    without_scripts.goto(kiosk.url)
    expect(without_scripts.get_by_role("button", name="Jog")).to_be_disabled()
    expect(without_scripts.locator("#why-jog")).to_contain_text("hold-to-run needs JavaScript")


def test_a_page_that_did_not_load_whole_is_loaded_again(kiosk: Server, page: Page) -> None:
    requested = []

    def cut_at_first(route: Route) -> None:
        """The request ahead of the page's scripts, and that of the script itself."""
        requested.append(route.request.url)
        if len(requested) <= 2:
            route.abort()
        else:
            route.continue_()

    page.route("**/holds.js", cut_at_first)
    page.goto(kiosk.url)
    page.wait_for_function("() => performance.getEntriesByType('navigation')[0].type === 'reload'")
    button = page.get_by_role("button", name="Jog")
    expect(button).to_be_enabled()

    def is_held() -> bool:
        button.dispatch_event("pointerdown", {"isPrimary": True, "button": 0, "pointerId": 7})
        return button.get_attribute("aria-pressed") == "true"

    until(is_held, "the script of the kind is there, and it is held", every_s=0.05)

"""Control as operators see it: browsers of their own, on the demo robot. One is at the cell, the
others come as through a proxy, which says where from."""

import os
import re
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, Error, Page, TimeoutError, expect

from tests.support.browser.browsers import ReusedPage
from tests.support.browser.pages import place
from tests.support.parts import CHROMIUM, CHROMIUM_FLAGS, ROOT, TAP_AGAIN_MS, Server, until
from tests.support.processes.signals import send_signal
from tests.support.servers import ready
from tests.web.test_control_over_http import PROXY, control_panel

pytestmark = [pytest.mark.long("detail"), pytest.mark.promise("control")]

IDLE_S = 4.0
EXPIRED_S = 2.3  # a touch counts for 2 s
FIRST, SECOND = "192.0.2.1", "192.0.2.2"

Opens = Callable[..., Page]


@pytest.fixture
def kiosk(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Server]:
    """A test may give further keys of the table [control]."""
    panel = control_panel(tmp_path, getattr(request, "param", ""))
    with ready(Server(ROOT, KIOSK_PANEL=str(panel), KIOSK_PROXIES=PROXY)) as mine:
        yield mine


ReusedPages = Callable[[str, bool], ReusedPage]


@pytest.fixture(scope="module")
def reused_pages(chromium: Browser) -> Iterator[ReusedPages]:
    """Pages that come from an address, "" for the cell, with or without scripts."""
    made: dict[tuple[str, bool], ReusedPage] = {}

    def reused(address: str, scripts: bool) -> ReusedPage:
        headers = {"x-forwarded-for": address} if address else {}
        if (address, scripts) not in made:
            made[address, scripts] = ReusedPage(
                chromium, extra_http_headers=headers, java_script_enabled=scripts
            )
        return made[address, scripts]

    yield reused
    for context in made.values():
        context.close()


@pytest.fixture
def opens(kiosk: Server, reused_pages: ReusedPages, request: pytest.FixtureRequest) -> Iterator[Opens]:
    """Opens the panel as in a browser of its own; an error on a console fails the test."""
    with ExitStack() as stack:

        def opened(address: str = "", scripts: bool = True) -> Page:
            page = stack.enter_context(reused_pages(address, scripts).taken(request.node))
            page.goto(kiosk.url)
            return page

        yield opened


@pytest.fixture
def other_chromium(chromium: Browser) -> Iterator[Browser]:
    """A browser with processes of its own, to be killed."""
    mine = chromium.browser_type.launch(executable_path=CHROMIUM, args=CHROMIUM_FLAGS)
    yield mine
    if mine.is_connected():
        mine.close()


def button(page: Page, name: str) -> Any:
    return page.get_by_role("button", name=name, exact=True)


def tap(page: Page, name: str) -> None:
    """Presses a button of the bar; what is sooner after another press is the same tap."""
    expect(page.locator("#control")).not_to_have_attribute("aria-busy", "true")
    button(page, name).click()


def bar(page: Page) -> Any:
    return page.locator("#control .who")


def has_role(page: Page, role: str) -> None:
    """What the panel is to who has control, as the server said last."""
    expect(page.locator("#control")).to_have_attribute("data-role", role)


def take(page: Page) -> None:
    tap(page, "Take control")
    has_role(page, "holding")


def locked_by(page: Page, name: str) -> None:
    """Another panel has control; the page says which."""
    expect(page.locator("#control")).to_have_attribute("data-role", re.compile("^(held|over)$"))
    expect(button(page, "Publish")).to_be_disabled()
    expect(page.locator("#why-operation")).to_contain_text(name)
    expect(bar(page)).to_contain_text(name)


def locked_free(page: Page) -> None:
    """No panel has control."""
    has_role(page, "free")
    expect(button(page, "Publish")).to_be_disabled()
    expect(page.locator("#why-operation")).not_to_be_empty()


def sends(page: Page) -> None:
    """Again where the robot took its permission back, or the machine stood still, in between."""
    receipt = page.locator("#receipt-operation")

    def sent() -> bool:
        page.get_by_label("Message").fill("hello")
        button(page, "Publish").click()
        expect(receipt).not_to_be_empty()
        return "Sent at" in receipt.inner_text()

    until(sent, "it is sent", every_s=0.5)


@pytest.mark.long(None)
def test_the_panel_at_the_cell_has_control_at_once(kiosk: Server, opens: Opens) -> None:
    cell = opens()
    has_role(cell, "holding")
    sends(cell)
    cell.wait_for_timeout(6000)  # longer than who is silent keeps it
    cell.reload()
    sends(cell)


def test_a_touch_that_a_stopped_server_finds_late_takes_no_control(kiosk: Server, opens: Opens) -> None:
    page = opens(FIRST)

    def answered_late() -> int | None:
        """The status; None where the page was locked before its touch, or waited no longer."""
        locked_free(page)
        expect(page.locator("#control")).not_to_have_attribute("aria-busy", "true")
        expect(button(page, "Take control")).to_be_enabled()
        kiosk.process.send(signal.SIGSTOP)
        try:
            with page.expect_response("**/control/take", timeout=10_000) as answered:
                button(page, "Take control").click(timeout=2000)
                page.wait_for_timeout(1000 * EXPIRED_S)
                kiosk.process.send(signal.SIGCONT)
            return answered.value.status
        except TimeoutError:
            return None
        finally:
            kiosk.process.send(signal.SIGCONT)

    assert until(answered_late, "a touch gets to the server late", within_s=120) == 409
    locked_free(page)
    take(page)


@pytest.mark.long(None)
def test_taking_looking_on_asking_keeping_and_giving(kiosk: Server, opens: Opens) -> None:
    first, second = opens(FIRST), opens(SECOND)
    locked_free(first)
    take(first)
    sends(first)
    locked_by(second, "Panel 1 (192.0.2.1)")
    expect(button(second, "Take control")).to_have_count(0)

    tap(second, "Request control")
    has_role(second, "asking")
    expect(bar(second)).to_contain_text("Panel 1 (192.0.2.1)")
    has_role(first, "asked")
    expect(bar(first)).to_contain_text("Panel 2 (192.0.2.2)")
    tap(first, "Keep")
    locked_by(second, "Panel 1 (192.0.2.1)")
    has_role(first, "holding")
    tap(second, "Request control")
    expect(second.locator("#control .refused")).to_contain_text("The request was denied")

    third = opens("192.0.2.3")
    tap(third, "Request control")
    tap(first, "Give")
    has_role(third, "holding")
    sends(third)
    for onlooker in (first, second):
        locked_by(onlooker, "Panel 3 (192.0.2.3)")
    tap(third, "Release control")
    for page in (first, second, third):
        locked_free(page)


def test_a_request_is_withdrawn(opens: Opens) -> None:
    first, second = opens(FIRST), opens(SECOND)
    take(first)
    tap(second, "Request control")
    expect(button(first, "Give")).to_be_visible()
    tap(second, "Cancel request")
    expect(button(first, "Release control")).to_be_visible()
    expect(button(first, "Give")).to_have_count(0)


@pytest.mark.parametrize("kiosk", [f"takeover_after_s = {IDLE_S}"], indirect=True)
def test_idle_holder_loses_control_on_request_and_active_holder_keeps_it(opens: Opens) -> None:
    first, second = opens(FIRST), opens(SECOND)
    take(first)
    tap(second, "Request control")
    expect(button(first, "Give")).to_be_visible()
    began = time.monotonic()
    while time.monotonic() - began < 1.5 * IDLE_S:
        first.mouse.click(640, 700)  # on nothing at all
        first.wait_for_timeout(500)
    has_role(first, "asked")
    has_role(second, "holding")
    locked_by(first, "Panel 2 (192.0.2.2)")
    sends(second)


def processes_of(browser: Browser) -> list[int]:
    session = browser.new_browser_cdp_session()
    return [int(p["id"]) for p in session.send("SystemInfo.getProcessInfo")["processInfo"]]


@pytest.mark.parametrize("fault", [signal.SIGKILL, signal.SIGSTOP])
def test_a_holder_whose_browser_is_killed_or_hangs_is_lost(
    kiosk: Server, opens: Opens, other_chromium: Browser, fault: signal.Signals
) -> None:
    first = other_chromium.new_page(extra_http_headers={"x-forwarded-for": FIRST})
    first.goto(kiosk.url)
    second = opens(SECOND)
    take(first)
    locked_by(second, "Panel 1 (192.0.2.1)")
    pids = processes_of(other_chromium)
    with first.expect_response("**/control/here"):
        pass  # it is silent from now on
    began = time.monotonic()
    try:
        for pid in pids:
            with suppress(ProcessLookupError):  # one ends with the others
                send_signal(pid, fault)
        has_role(second, "free")
        assert time.monotonic() - began > 3
        locked_free(second)
        take(second)
    finally:
        for pid in pids if fault == signal.SIGSTOP else ():
            with suppress(ProcessLookupError):
                os.kill(pid, signal.SIGCONT)
    if fault == signal.SIGSTOP:
        locked_by(first, "Panel 2 (192.0.2.2)")
    else:
        with pytest.raises(Error):
            first.title()


def test_closed_page_frees_control_for_the_requester(opens: Opens) -> None:
    first, second = opens(FIRST), opens(SECOND)
    take(first)
    tap(second, "Request control")
    expect(button(first, "Give")).to_be_visible()
    first.close()
    has_role(second, "holding")


@pytest.mark.long("real time")
def test_two_taps_take_control_and_do_not_release_control(opens: Opens) -> None:
    first = opens(FIRST)
    button(first, "Take control").dblclick(delay=20)
    expect(button(first, "Release control")).to_be_visible()
    release = place(button(first, "Release control"))
    first.mouse.click(release["x"] + 5, release["y"] + 5)
    first.wait_for_timeout(1000)
    has_role(first, "holding")


def test_without_scripts_forms_do_the_same(kiosk: Server, opens: Opens) -> None:
    first, second = opens(FIRST, scripts=False), opens(SECOND, scripts=False)
    locked_free(first)
    tap(first, "Take control")
    has_role(first, "holding")
    first.wait_for_timeout(TAP_AGAIN_MS)
    sends(first)
    second.reload()
    locked_by(second, "Panel 1 (192.0.2.1)")
    tap(second, "Request control")
    has_role(second, "asking")
    first.reload()
    tap(first, "Give")
    locked_by(first, "Panel 2 (192.0.2.2)")
    second.reload()
    second.wait_for_timeout(TAP_AGAIN_MS)
    sends(second)
    tap(second, "Release control")
    locked_free(second)


def test_page_opened_by_a_link_on_another_site_is_identified(kiosk: Server, opens: Opens) -> None:
    first = opens(FIRST)
    take(first)
    linking = first.context.new_page()
    link = f'<a href="{kiosk.url}/">panel</a>'
    linking.route(
        "http://wiki.example/", lambda route: route.fulfill(body=link, content_type="text/html")
    )
    linking.goto("http://wiki.example/")
    linking.get_by_role("link").click()
    has_role(linking, "holding")
    sends(linking)
    sends(first)

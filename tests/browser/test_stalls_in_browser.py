"""A page that stood still, or whose events crawl: when it goes on it shows what is so now, and nothing
that has waited on the way."""

import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.support.browser.line import Line
from tests.support.parts import Bridge, RosNode, Server, live, until
from tests.support.processes.signals import send_signal

pytestmark = [pytest.mark.long("detail"), pytest.mark.promise("reconnect")]

STOOD_STILL_S: Final = 5.0
UPDATES_PER_S: Final = 50.0
BYTES_PER_S: Final = 1_000  # of a line that carries less than what is said

TELL_WHAT_IS_SHOWN: Final = """() => {
    const value = document.querySelector('[data-widget="last_heard"] .value');
    window.shown = [];
    new MutationObserver(() => shown.push(value.textContent)).observe(
        value, { childList: true, characterData: true, subtree: true },
    );
}"""


@pytest.fixture
def kiosk(bridge: Bridge, node: RosNode, tmp_path: Path) -> Iterator[Server]:
    mine = live(bridge.endpoint, tmp_path)
    node.advertise("/last_heard", "std_msgs/msg/String")
    until(lambda: node.subscribers("/last_heard"), "the bridge listens")
    yield mine
    node.withdraw("/last_heard")
    mine.end()


@contextmanager
def stopped(chromium: Browser) -> Iterator[None]:
    """The processes that run pages stand still: what comes waits in the browser and in the kernel."""
    session = chromium.new_browser_cdp_session()
    processes = session.send("SystemInfo.getProcessInfo")["processInfo"]
    pages = [process["id"] for process in processes if process["type"] == "renderer"]
    assert pages
    for process in pages:
        send_signal(process, signal.SIGSTOP)
    try:
        yield
    finally:
        for process in pages:
            os.kill(process, signal.SIGCONT)
        session.detach()


def follows(page: Page, node: RosNode) -> None:
    """The page shows what the robot says."""
    value = page.locator('[data-widget="last_heard"] .value')

    def shows() -> bool:
        node.publish("/last_heard", {"data": "before"})
        return value.text_content() == "before"

    until(shows, "what the robot says is shown", every_s=0.2)


@pytest.mark.long(None)
def test_resumed_page_shows_the_present_state_only(
    kiosk: Server, node: RosNode, chromium: Browser, page: Page
) -> None:
    page.goto(kiosk.url)
    follows(page, node)
    page.evaluate(TELL_WHAT_IS_SHOWN)
    with stopped(chromium):
        node.flood("/last_heard", {"data": "{n} waited"}, UPDATES_PER_S, STOOD_STILL_S)
        node.publish("/last_heard", {"data": "now"})
        until(lambda: kiosk.widget("last_heard")["text"] == "now", "the server knows it")
    expect(page.locator('[data-widget="last_heard"] .value')).to_have_text("now")
    shown = page.evaluate("shown")
    assert [text for text in shown if "waited" in text] == []
    assert shown[-1] == "now"
    expect(page.get_by_role("button", name="Publish", exact=True)).to_be_enabled()


@pytest.fixture
def line(kiosk: Server) -> Iterator[Line]:
    with Line(kiosk.port, BYTES_PER_S) as mine:
        yield mine


def test_page_with_delayed_events_reconnects(
    kiosk: Server, node: RosNode, page: Page, line: Line
) -> None:
    page.goto(line.url)
    follows(page, node)
    opened = line.opened
    line.slow = True
    said = {"data": "{n} " + "long " * 30}
    lost = '[data-lamp="server"][data-state="bad"]'
    page.evaluate(
        """(lost) => new MutationObserver(() => { window.lost ||= !!document.querySelector(lost) })
        .observe(document.querySelector('[data-lamp="server"]'), { attributes: true })""",
        lost,
    )
    until(
        lambda: node.flood("/last_heard", said, UPDATES_PER_S, 1.0) and line.opened > opened,
        "it asks anew",
        within_s=40,
    )
    assert page.evaluate("window.lost")
    line.slow = False
    expect(page.get_by_role("button", name="Publish", exact=True)).to_be_enabled()
    follows(page, node)

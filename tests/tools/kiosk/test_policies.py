"""What the browser's policies forbid, with the real Chromium, which reads them in a mount namespace."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.browser.screen import KioskScreen
from tests.support.parts import ROOT, Server, until

pytestmark = pytest.mark.usefixtures("namespaces")

# Chromium reads the policies of /etc/chromium only.
MOUNT = (
    "mount -t tmpfs tmpfs /etc/chromium && mkdir -p /etc/chromium/policies/managed"
    ' && cp "$1" /etc/chromium/policies/managed && shift && exec "$@"'
)


@pytest.fixture
def screen(demo: Server, tmp_path: Path) -> Iterator[KioskScreen]:
    folder = tmp_path / "run"
    shipped = (ROOT / "deploy/kiosk-policies.json").read_text()
    policies = tmp_path / "operator-panel.json"
    policies.write_text(shipped.replace("/run/operator-panel-kiosk", str(folder)))
    before = ("unshare", "--mount", "sh", "-c", MOUNT, "sh", str(policies))
    mine = KioskScreen(demo.url, folder, "--compositor=none", before=before)
    yield mine
    mine.end()


def test_the_watcher_sees_the_page_and_other_addresses_are_blocked(screen: KioskScreen) -> None:
    until(screen.lives, "the panel is shown")
    for url in ("file:///etc/passwd", "chrome://settings/", "http://192.0.2.1/"):
        screen.evaluate("window.before = true")
        answer = screen.call("Page.navigate", url=url)
        assert answer is not None
        assert answer.get("errorText") == "net::ERR_BLOCKED_BY_ADMINISTRATOR", (url, answer)
        until(lambda: not screen.evaluate("window.before"), "the page is gone")
        until(screen.lives, "the panel is back")


def test_the_waiting_page_is_allowed(screen: KioskScreen, demo: Server) -> None:
    until(screen.lives, "the panel is shown")
    waiting = screen.folder / "waiting.html"
    waiting.write_text("<!doctype html><body data-waiting>")
    answer = screen.call("Page.navigate", url=waiting.as_uri())
    assert answer is not None
    assert "errorText" not in answer
    until(screen.lives, "the panel is back")

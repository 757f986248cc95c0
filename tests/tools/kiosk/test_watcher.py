"""The kiosk's screen with the real Chromium: what hangs or crashes is back, and no press is doubled."""

import csv
import io
import json
import secrets
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

import pytest

from app.system.texts import render, say
from tests.support.browser.screen import KioskScreen
from tests.support.form import MEASURES
from tests.support.parts import ENOUGH_S, ROOT, Bridge, RosNode, Server, free_port, live, until
from tests.support.servers import ready

pytestmark = pytest.mark.promise("kiosk")

BACK_WITHIN_S: Final = 10.0
PANEL: Final = ROOT / "app/panel.toml"
LANGUAGES: Final = ("en", "ja", "de")

Fault = Callable[[KioskScreen], object]
FAULTS: Final[dict[str, Fault]] = {
    "browser killed": lambda screen: screen.send("browser", signal.SIGKILL),
    "browser frozen": lambda screen: screen.send("browser", signal.SIGSTOP),
    "page frozen": lambda screen: screen.send("renderer", signal.SIGSTOP),
    "page killed": lambda screen: screen.send("renderer", signal.SIGKILL),
    "page crashed": lambda screen: screen.call("Page.crash"),
    "page in a loop": lambda screen: screen.evaluate("setTimeout(() => { for (;;); })"),
    "GPU process killed": lambda screen: screen.send("GPU", signal.SIGKILL),
    "GPU process frozen": lambda screen: screen.send("GPU", signal.SIGSTOP),
    "blank page": lambda screen: screen.call("Page.navigate", url="about:blank"),
    "no page": lambda screen: screen.call("Page.close"),
    "another window": lambda screen: screen.call("Target.createTarget", url="about:blank"),
    "scripts stopped": lambda screen: screen.evaluate("operatorPanel.eventAgeMs = () => 60_000"),
}


@pytest.fixture
def screens(tmp_path: Path) -> Iterator[Callable[..., KioskScreen]]:
    made: list[KioskScreen] = []

    def make(url: str, *options: str, **more: Any) -> KioskScreen:
        made.append(KioskScreen(url, tmp_path / "run", "--compositor=none", *options, **more))
        return made[-1]

    yield make
    for kiosk_screen in made:
        kiosk_screen.end()


@pytest.fixture(scope="module")
def server(bridge: Bridge, node: RosNode, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with ready(live(bridge.endpoint, tmp_path_factory.mktemp("server"))) as mine:
        yield mine


@pytest.fixture(scope="module")
def screen(server: Server, tmp_path_factory: pytest.TempPathFactory) -> Iterator[KioskScreen]:
    """One for all faults: each comes to a watcher that has met others."""
    folder = tmp_path_factory.mktemp("screen") / "run"
    mine = KioskScreen(server.url, folder, "--compositor=none", f"--panel={PANEL}")
    yield mine
    mine.end()


def published(server: Server, name: str) -> list[str]:
    """The texts of the presses that the operator's log says were published, the oldest first."""
    rows = list(csv.DictReader(io.StringIO(server.http.get("/log.csv").text)))
    texts = [
        json.loads(row["values"])["message"] for row in reversed(rows) if row["outcome"] == "published"
    ]
    return [text for text in texts if text.startswith(name)]


def heard(node: RosNode, name: str) -> list[str]:
    return [text for text in node.heard_data("/operation") if text.startswith(name)]


# These leave the page as it is.
PAGE_STAYS: Final = {"GPU process killed", "another window"}
# With these it is measured how soon the panel is back; with the others it is shown that it is. Except
# in `make faults` only with the one that takes longest.
TIMED: Final = {*FAULTS} if MEASURES else {"GPU process frozen"}
SHOWN: Final = {"browser killed", "page frozen", "scripts stopped"}  # by `make test-robot`


def mark(fault: str) -> tuple[pytest.MarkDecorator, ...]:
    if fault in TIMED:
        return (pytest.mark.long("real time"),)
    return () if fault in SHOWN else (pytest.mark.long("fault"),)


@pytest.mark.parametrize(
    "fault",
    [pytest.param(f, marks=mark(f)) for f in sorted(FAULTS)],
)
def test_hanging_or_crashed_process_is_restarted(
    server: Server, node: RosNode, screen: KioskScreen, fault: str
) -> None:
    took_s = break_and_press_on(server, node, screen, fault)
    if fault in TIMED:
        assert took_s < BACK_WITHIN_S, screen.process.text


def break_and_press_on(server: Server, node: RosNode, screen: KioskScreen, fault: str) -> float:
    """The seconds until the panel is back. No press is lost or doubled."""
    until(screen.lives, "the panel is shown")
    name = f"{fault} {secrets.token_hex(4)}"
    screen.press_on(name)
    until(lambda: len(heard(node, name)) >= 3, "presses arrive")

    screen.evaluate("window.before = true")
    FAULTS[fault](screen)
    broken = time.monotonic()
    if fault not in PAGE_STAYS:
        until(lambda: not screen.evaluate("window.before"), "the page is gone")
    until(screen.lives, "the panel is back")
    took_s = time.monotonic() - broken
    before = len(heard(node, name))
    screen.press_on(f"{name}, after")
    until(lambda: len(heard(node, name)) > before, "presses arrive again")
    screen.stop_presses()

    sent: list[str] = []
    arrived: list[str] = []

    def same() -> bool:
        sent[:], arrived[:] = published(server, name), heard(node, name)
        return sent == arrived

    with suppress(AssertionError):
        until(same, "each was sent", within_s=10)
    assert sent == arrived
    assert len(arrived) == len(set(arrived))
    return took_s


def test_kiosk_waits_for_the_server_with_a_page_in_the_panels_languages(
    screens: Callable[..., KioskScreen], servers: Callable[[Server], Server]
) -> None:
    port = free_port()
    screen = screens(f"http://127.0.0.1:{port}", f"--panel={PANEL}")
    shown = "document.body?.dataset.waiting !== undefined && document.body.innerText"
    text = until(lambda: screen.evaluate(shown), "the waiting page is shown")
    assert [
        language for language in LANGUAGES if render(say("kiosk_starting"), language) not in text
    ] == []
    assert "Robot cell 1" in text

    servers(Server(ROOT, port))
    until(screen.lives, "the panel is shown")
    assert screen.evaluate("document.documentElement.lang") == "en"


def test_the_screen_is_first_in_the_language_of_the_panel_file(
    screens: Callable[..., KioskScreen], servers: Callable[[Server], Server], tmp_path: Path
) -> None:
    panel = tmp_path / "panel.toml"
    panel.write_text('language = "ja"\n' + PANEL.read_text())
    server = servers(Server(ROOT, KIOSK_PANEL=str(panel)))
    screen = screens(server.url, f"--panel={panel}")
    until(screen.lives, "the panel is shown")
    assert screen.evaluate("document.documentElement.lang") == "ja"


def test_a_lost_server_leaves_the_locked_page_and_its_reason(
    screens: Callable[..., KioskScreen], servers: Callable[[Server], Server]
) -> None:
    server = servers(Server(ROOT))
    screen = screens(server.url, f"--panel={PANEL}")
    until(screen.lives, "the panel is shown")
    screen.evaluate("window.before = true")
    server.process.kill()
    until(lambda: screen.evaluate("'cut' in document.body.dataset"), "the page is locked")
    servers(Server(ROOT, server.port))
    until(screen.lives, "the panel is back")


def test_kiosk_reports_ready_and_alive_to_the_service_manager(
    screens: Callable[..., KioskScreen], servers: Callable[[Server], Server], tmp_path: Path
) -> None:
    address = tmp_path / "notify"
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind(str(address))
        manager.settimeout(ENOUGH_S)
        server = servers(Server(ROOT))
        screen = screens(server.url, f"--panel={PANEL}", NOTIFY_SOCKET=str(address))
        first, second = (manager.recv(4096).decode().splitlines() for _ in range(2))
        assert first[:2] == ["READY=1", "WATCHDOG=1"]
        assert "WATCHDOG=1" in second
        screen.end()
        lines: list[str] = []
        while "STOPPING=1" not in lines:
            lines = manager.recv(4096).decode().splitlines()


def test_a_browser_that_is_missing_is_named(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "app.cli", "kiosk", "--browser=no-browser", f"--folder={tmp_path}"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr == (
        "there is no browser no-browser: install it, or name another one as browser\n"
    )

"""The kiosk's screen in the real compositor, which has no screen here: what it shows, and keys."""

import os
import subprocess
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Final

import pytest

from tests.support.browser.screen import WITHOUT_GPU, KioskScreen
from tests.support.parts import ROOT, Server, until

# The compositor does not run as root.
NO_ROOT: Final = ("unshare", "--user", "--map-user=1000", "--map-group=1000")
NO_SCREEN: Final = {
    "WLR_BACKENDS": "headless",
    "WLR_LIBINPUT_NO_DEVICES": "1",
    "WLR_RENDERER": "pixman",
}
PICTURE: Final = (1280, 720)
SHORTCUTS: Final = (
    *("ctrl t", "ctrl n", "ctrl w", "ctrl o", "ctrl p", "ctrl s", "ctrl u", "ctrl l", "ctrl h"),
    *("ctrl plus", "ctrl minus", "ctrl+shift i", "ctrl+shift n", "ctrl+shift w", "ctrl Tab", "alt F4"),
    *(
        "alt Left",
        "alt d",
        "ctrl+alt F2",
        "ctrl+alt Delete",
        "F1",
        "F3",
        "F5",
        "F6",
        "F7",
        "F11",
        "F12",
    ),
)

COLLECT_KEYS: Final = """
    window.typed = [];
    addEventListener("keydown", (event) => window.typed.push(event.key));
"""


class SwayScreen(KioskScreen):
    """A kiosk's screen with its compositor; keys are typed into the compositor."""

    _keyboard: subprocess.Popen[bytes] | None = None

    @property
    def _env(self) -> dict[str, str]:
        display = (self.folder / "wayland-display").read_text()
        return {**os.environ, "XDG_RUNTIME_DIR": str(self.folder), "WAYLAND_DISPLAY": display}

    def _run(self, *command: str) -> subprocess.CompletedProcess[bytes]:
        return subprocess.run(command, env=self._env, check=True, capture_output=True, timeout=30)

    def plug_in_keyboard(self) -> None:
        """A keyboard that stays: the page has the focus while there is one."""
        self._keyboard = subprocess.Popen(["wtype", "-s", "1000000"], env=self._env)
        until(lambda: self.evaluate("document.hasFocus()"), "the page has the focus")

    def unplug_keyboard(self) -> None:
        if self._keyboard is not None:
            self._keyboard.kill()
            self._keyboard.wait()
            self._keyboard = None

    def end(self) -> None:
        self.unplug_keyboard()
        super().end()

    def picture(self) -> tuple[int, int, bytes]:
        """(width, height, RGB) of what the screen shows."""
        kind, width, height, _, pixels = self._run("grim", "-t", "ppm", "-").stdout.split(maxsplit=4)
        assert kind == b"P6"
        return int(width), int(height), pixels

    def type(self, shortcut: str) -> None:
        """Types a key with its modifiers, such as "ctrl+shift i"."""
        *modifiers, key = shortcut.replace("+", " ").split()
        held = [word for name in modifiers for word in ("-M", name)]
        self._run("wtype", *held, "-k", key)

    def tell(self, *command: str) -> None:
        """Tells the compositor something."""
        socket = str(self.folder / "sway.sock")
        subprocess.run(["swaymsg", "-s", socket, "--", *command], check=False, capture_output=True)


def started(server: Server, folder: Path, *options: str) -> SwayScreen:
    """A screen that shows the panel."""
    panel = f"--panel={ROOT / 'app/panel.toml'}"
    screen = SwayScreen(
        server.url, folder / "r", panel, *options, before=NO_ROOT, flags=WITHOUT_GPU, **NO_SCREEN
    )
    try:
        until(screen.lives, "the panel is shown")
    except BaseException:
        screen.end()
        raise
    return screen


@pytest.fixture
def sway(tmp_path: Path, demo: Server) -> Iterator[Callable[..., SwayScreen]]:
    """Starts a screen with options of the test's own."""
    with ExitStack() as stack:

        def make(*options: str) -> SwayScreen:
            screen = started(demo, tmp_path, *options)
            stack.callback(screen.end)
            return screen

        yield make


@pytest.fixture(scope="module")
def usual(tmp_path_factory: pytest.TempPathFactory, demo: Server) -> Iterator[SwayScreen]:
    screen = started(demo, tmp_path_factory.mktemp("usual"))
    yield screen
    screen.end()


@pytest.fixture
def screen(usual: SwayScreen) -> Iterator[SwayScreen]:
    """The screen without options, which the tests of this file share."""
    until(usual.lives, "the panel is shown")
    yield usual
    usual.unplug_keyboard()


def colours(pixels: bytes) -> set[bytes]:
    return {pixels[at : at + 3] for at in range(0, len(pixels) - 2, 3)}


def test_the_panel_fills_the_screen(screen: SwayScreen) -> None:
    width, height, _ = screen.picture()
    assert (width, height) == PICTURE
    assert screen.evaluate("[innerWidth, innerHeight]") == [*PICTURE]
    until(lambda: len(colours(screen.picture()[2])) > 50, "a whole page is drawn")


def test_a_rotated_screen_is_laid_out_upright(sway: Callable[..., SwayScreen]) -> None:
    screen = sway("--rotate=90")
    assert screen.picture()[:2] == PICTURE[::-1]
    assert screen.evaluate("[innerWidth, innerHeight]") == [*PICTURE[::-1]]


def test_no_key_leads_out_of_the_panel(screen: SwayScreen) -> None:
    screen.plug_in_keyboard()
    screen.evaluate("window.before = devicePixelRatio")
    screen.evaluate(COLLECT_KEYS)
    for shortcut in SHORTCUTS:
        screen.type(shortcut)
    screen.type("z")
    until(lambda: "z" in screen.evaluate("window.typed"), "keys arrive in the panel")
    typed = screen.evaluate("window.typed")
    assert {"t", "n", "w", "p", "i", "F4", "F11", "F12"} <= set(typed), typed
    until(screen.lives, "nothing but the panel is shown")
    assert screen.evaluate("window.before === devicePixelRatio")
    assert screen.evaluate("[innerWidth, innerHeight]") == [*PICTURE]


def test_waking_touch_does_not_reach_the_panel(sway: Callable[..., SwayScreen], tmp_path: Path) -> None:
    config = tmp_path / "kiosk.toml"
    config.write_text("off_after_s = 2\n")
    screen = sway(f"--config={config}")
    screen.plug_in_keyboard()
    screen.evaluate(COLLECT_KEYS)
    until(lambda: "the screen goes off" in screen.process.text, "the screen is dark")
    screen.type("a")
    until(lambda: "touches count again" in screen.process.text, "the screen is awake")

    def typed() -> list[str]:
        screen.type("b")
        characters: list[str] = screen.evaluate("window.typed")
        return characters

    assert set(until(typed, "keys arrive again", every_s=0.2)) == {"b"}


def test_a_compositor_that_ends_is_started_again(screen: SwayScreen) -> None:
    screen.evaluate("window.before = true")
    screen.tell("exit")
    until(lambda: not screen.evaluate("window.before"), "the page is gone")
    until(screen.lives, "the panel is back")
    assert screen.picture()[:2] == PICTURE

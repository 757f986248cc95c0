"""The file of a kiosk's screen, its compositor's configuration, and when the screen may be off."""

import tomllib
from datetime import time
from pathlib import Path

import pytest

from app.system.errors import SettingsError
from app.tools.kiosk.config import KioskConfig, panel_language, read_config, runtime_folder
from app.tools.kiosk.screen import may_be_off, sway_config
from tests.support.parts import ROOT


def test_the_shipped_file_is_good_with_and_without_its_comments(tmp_path: Path) -> None:
    shipped = ROOT / "deploy/kiosk.toml"
    assert read_config(shipped) == KioskConfig()
    lines = [
        line.removeprefix("# ") if " = " in line else line for line in shipped.read_text().splitlines()
    ]
    path = tmp_path / "kiosk.toml"
    path.write_text("\n".join(lines))
    config = read_config(path)
    assert (config.rotate, config.off_between) == (90, ("22:00", "05:00"))
    assert set(tomllib.loads(path.read_text())) == set(KioskConfig.__dataclass_fields__) - {
        "compositor"
    }


def test_options_override_the_configuration_file(tmp_path: Path) -> None:
    path = tmp_path / "kiosk.toml"
    path.write_text("rotate = 90\noff_after_s = 60\n")
    config = read_config(path, rotate=180, browser=None)
    assert (config.rotate, config.off_after_s, config.browser) == (180, 60, "")


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("rotat = 90", "did you mean rotate"),
        ("rotate = 45", "0, 90, 180 or 270"),
        ('rotate = "90"', "rotate must be a whole number"),
        ("off_after_s = true", "off_after_s must be a whole number"),
        ("off_after_s = -1", "0 for never"),
        ('off_between = ["22:00"]', "two times"),
        ('off_between = ["22:00", "25:00"]', "two times"),
        ('flags = "x"', "flags must be a list"),
        ('url = "http://192.0.2.1:8000/"', "on this machine"),
        ('url = "file:///etc/passwd"', "on this machine"),
        ('url = "http://[::1/"', "on this machine"),
        ('url = "http://127.0.0.1:99999/"', "on this machine"),
        ('compositor = "x11"', "one of sway, none"),
        ('output = "HDMI\\nbindsym"', "only letters"),
        ("rotate =", "can't be read"),
    ],
)
def test_a_mistake_is_named(tmp_path: Path, line: str, said: str) -> None:
    path = tmp_path / "kiosk.toml"
    path.write_text(line)
    with pytest.raises(SettingsError, match=said) as raised:
        read_config(path)
    assert str(path) in str(raised.value)


def test_no_key_of_the_compositor_is_bound() -> None:
    text = sway_config(KioskConfig(rotate=270, output="HDMI-A-1", mode="1920x1080"), Path("/run/d"))
    assert "bindsym" not in text
    assert "srvrkeys:none" in text
    assert "output HDMI-A-1 transform 270\n" in text
    assert "output HDMI-A-1 mode 1920x1080\n" in text


@pytest.mark.parametrize(
    ("between", "now", "off"),
    [
        ((), "12:00", True),
        (("22:00", "05:00"), "23:59", True),
        (("22:00", "05:00"), "04:59", True),
        (("22:00", "05:00"), "05:00", False),
        (("22:00", "05:00"), "21:59", False),
        (("01:00", "05:00"), "00:59", False),
        (("01:00", "05:00"), "01:00", True),
    ],
)
def test_the_screen_may_be_off_at_night(between: tuple[str, ...], now: str, off: bool) -> None:
    assert may_be_off(between, time.fromisoformat(now)) is off


def test_the_profile_is_in_the_units_folder() -> None:
    assert runtime_folder({"RUNTIME_DIRECTORY": "/run/a:/run/b"}) == Path("/run/a")
    assert runtime_folder({"XDG_RUNTIME_DIR": "/run/user/1"}) == Path("/run/user/1")


@pytest.mark.parametrize(
    ("text", "language"), [("", "en"), ('language = "ja"', "ja"), ("language = 1", ""), ("x =", "")]
)
def test_the_language_of_a_panel_file(tmp_path: Path, text: str, language: str) -> None:
    path = tmp_path / "panel.toml"
    path.write_text(text)
    assert panel_language(path) == language
    assert panel_language(tmp_path / "none.toml") == ""

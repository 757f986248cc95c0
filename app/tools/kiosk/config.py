"""The file of a kiosk's screen, /etc/operator-panel/kiosk.toml."""

import os
import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, fields
from difflib import get_close_matches
from pathlib import Path
from typing import Any, Final, get_origin, get_type_hints
from urllib.parse import urlsplit

from app.system.errors import SettingsError

BROWSERS: Final = ("chromium", "google-chrome-stable", "chromium-browser")
COMPOSITORS: Final = ("sway", "none")
LOOPBACK: Final = frozenset({"127.0.0.1", "localhost", "::1"})
ROTATIONS: Final = (0, 90, 180, 270)
CLOCK_TIME: Final = re.compile(r"([01]\d|2[0-3]):[0-5]\d")
DEFAULT_URL: Final = "http://127.0.0.1:8000/"
RUNTIME: Final = "/run/operator-panel-kiosk"


@dataclass(frozen=True, slots=True, kw_only=True)
class KioskConfig:
    """The keys of the file; see docs/how-to/kiosk.md.

    `off_after_s` is 0 if the screen stays on. `off_between` is two times of the day, "22:00" and
    "05:00"; without it the screen may go off at any time.
    """

    url: str = DEFAULT_URL
    panel: str = "/etc/operator-panel/panel.toml"
    compositor: str = "sway"
    browser: str = ""
    flags: tuple[str, ...] = ()
    output: str = ""
    mode: str = ""
    rotate: int = 0
    off_after_s: int = 0
    off_between: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not _is_of_this_machine(self.url):
            raise SettingsError(
                f'url is "{self.url}": the address of the panel server on this machine, such as '
                "http://127.0.0.1:8000/"
            )
        if self.compositor not in COMPOSITORS:
            raise SettingsError(f'compositor is "{self.compositor}": one of {", ".join(COMPOSITORS)}')
        if self.rotate not in ROTATIONS:
            raise SettingsError(f"rotate is {self.rotate}: 0, 90, 180 or 270, clockwise")
        if self.off_after_s < 0:
            raise SettingsError(f"off_after_s is {self.off_after_s}: seconds, 0 for never")
        between = self.off_between
        if between and (len(between) != 2 or not all(map(CLOCK_TIME.fullmatch, between))):
            raise SettingsError('off_between must be two times, such as ["22:00", "05:00"]')
        for name in ("output", "mode"):  # they become a line of the compositor's configuration
            if not re.fullmatch(r"[\w.@-]*", getattr(self, name)):
                raise SettingsError(f'{name} is "{getattr(self, name)}": only letters, digits, . @ -')

    @property
    def origin(self) -> str:
        """`http://127.0.0.1:8000`, with which every page of the panel begins."""
        parts = urlsplit(self.url)
        return f"{parts.scheme}://{parts.netloc}"


def _is_of_this_machine(url: str) -> bool:
    try:
        parts = urlsplit(url)
        port = parts.port
    except ValueError:  # a bracket without its other, or no port
        return False
    return parts.scheme in ("http", "https") and parts.hostname in LOOPBACK and port != 0


def runtime_folder(env: Mapping[str, str] = os.environ) -> Path:
    """A folder in memory for the browser's profile: that of the unit, else of the user's session."""
    folder = env.get("RUNTIME_DIRECTORY") or env.get("XDG_RUNTIME_DIR") or RUNTIME
    return Path(folder.split(":")[0])


def read_config(path: Path | None, **options: Any) -> KioskConfig:
    """The file's keys, and over them those that are given and not None. SettingsError names the key."""
    settings: dict[str, Any] = {}
    if path is not None:
        try:
            settings = tomllib.loads(path.read_text())
        except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
            raise SettingsError(f"{path} can't be read: {error}") from error
    settings |= {name: value for name, value in options.items() if value is not None}
    try:
        return KioskConfig(**dict(_value_of(name, value) for name, value in settings.items()))
    except SettingsError as error:
        raise SettingsError(f"{path}: {error}" if path else str(error)) from None


def _value_of(name: str, value: Any) -> tuple[str, Any]:
    names = [field.name for field in fields(KioskConfig)]
    if name not in names:
        close = get_close_matches(name, names, 1)
        hint = f"did you mean {close[0]}?" if close else f"there are {', '.join(names)}"
        raise SettingsError(f"{name} is not a key of a kiosk's file: {hint}")
    kind = get_type_hints(KioskConfig)[name]
    if get_origin(kind) is tuple:
        if not isinstance(value, (list, tuple)) or not all(
            isinstance(element, str) for element in value
        ):
            raise SettingsError(f"{name} must be a list of texts")
        return name, tuple(value)
    if type(value) is not kind:
        raise SettingsError(f"{name} must be {'a text' if kind is str else 'a whole number'}")
    return name, value


# The language of a panel file, as the browser requests it at first.

TAG: Final = re.compile(r"[A-Za-z]{2,3}(-[A-Za-z0-9]{2,8})*")


def panel_language(panel: Path) -> str:
    """`language` of the file, "en" where it does not say; "" if it can't be read: the server
    reports what is wrong with it."""
    try:
        language = tomllib.loads(panel.read_text()).get("language", "en")
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError):
        return ""
    return language if isinstance(language, str) and TAG.fullmatch(language) else ""

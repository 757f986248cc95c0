"""Arguments that several commands have, and the data folder that they name."""

import os
import sys
from argparse import ArgumentTypeError
from collections.abc import Callable, Mapping
from contextlib import suppress
from datetime import datetime
from math import inf
from pathlib import Path
from typing import Any, Final

from app.ros.dialects.dialect import DOMAIN_MOST
from app.system.errors import SettingsError, os_error_text
from app.system.settings import Settings
from app.system.texts import render
from app.tools.cli.parser import Parser

# Arguments that several commands have: types whose mistake is one sentence, and the settings.

HIGHEST_PORT: Final = 65_535
PANEL_HELP: Final = (
    "the panel file, or the name of a shipped one (mobile-robot); without one that of KIOSK_PANEL, else"
    " that of the palletizing cell"
)
# Options that stand for a variable of the environment, and go before it.
VARIABLES: Final[Mapping[str, str]] = {
    "panel": "KIOSK_PANEL",
    "zenoh": "KIOSK_ZENOH",
    "mode": "KIOSK_MODE",
    "data": "KIOSK_DATA",
    "names": "KIOSK_HOSTS",
    "proxies": "KIOSK_PROXIES",
    "root_path": "KIOSK_ROOT_PATH",
    "log_level": "KIOSK_LOG_LEVEL",
    "without": "KIOSK_WITHOUT",
    "wall": "KIOSK_WALL",
}


def add_settings(parser: Parser) -> None:
    """PANEL, --mode, --zenoh, --data."""
    add = parser.add_argument
    add("panel", nargs="?", metavar="PANEL", help=PANEL_HELP)
    add("--mode", choices=("demo", "live"), help="instead of what the panel file says (KIOSK_MODE)")
    add("--zenoh", metavar="FILE", help="Zenoh configuration (KIOSK_ZENOH)")
    add("--data", metavar="FOLDER", help="where the operator's log and recordings are (KIOSK_DATA)")


def environment(options: Any) -> dict[str, str]:
    """The variables of the options that were given; several names are one list."""
    variables = {}
    for option, variable in VARIABLES.items():
        value = getattr(options, option, None)
        if value is not None:
            variables[variable] = ",".join(value) if isinstance(value, list) else str(value)
    return variables


TOKEN: Final = "OPERATOR_PANEL_TOKEN"


def add_kiosk(parser: Parser) -> None:
    """--token-file, --trust: of a kiosk that is asked over HTTP."""
    add = parser.add_argument
    add("--token-file", type=Path, metavar="FILE", help="a file with the token; - is standard input")
    add(
        "--trust",
        default="",
        metavar="FILE",
        help="the certificate authority of the kiosk, or the SHA-256 of its certificate; default: the"
        " system's authorities",
    )


def kiosk_token(options: Any) -> str | None:
    """The token of --token-file or of the environment; None without one. SettingsError if it can't be
    read."""
    if options.token_file is None:
        return os.environ.get(TOKEN) or None
    try:
        text: str = (
            sys.stdin.readline() if str(options.token_file) == "-" else options.token_file.read_text()
        )
    except (OSError, UnicodeDecodeError) as error:
        why = os_error_text(error) if isinstance(error, OSError) else "it is not text"
        raise SettingsError(f"the token can't be read: {render(why)}") from error
    return text.strip()


def ros_domain(text: str) -> int:
    """A ROS_DOMAIN_ID: 0 to 232."""
    if not 0 <= (number := _digits(text)) <= DOMAIN_MOST:
        raise ArgumentTypeError(f'"{text}" is not a ROS domain: 0 to {DOMAIN_MOST}')
    return number


def port(text: str) -> int:
    """Of a server that runs: 1 to 65535."""
    if not 0 < (number := _digits(text)) <= HIGHEST_PORT:
        raise ArgumentTypeError(f'"{text}" is not a port: 1 to {HIGHEST_PORT}')
    return number


def port_to_listen(text: str) -> int:
    """0 for any that is free."""
    if not 0 <= (number := _digits(text)) <= HIGHEST_PORT:
        raise ArgumentTypeError(
            f'"{text}" is not a port: 1 to {HIGHEST_PORT}, or 0 for any that is free'
        )
    return number


def whole_number(lowest: int) -> Callable[[str], int]:
    """The type of a number from `lowest` on."""

    def checked(text: str) -> int:
        if (number := _digits(text)) < lowest:
            raise ArgumentTypeError(f'"{text}" is not a whole number from {lowest} on')
        return number

    return checked


def seconds(most: float = inf) -> Callable[[str], float]:
    """The type of a time above 0."""
    right = "a number of seconds above 0" if most == inf else f"up to {most:g} seconds"

    def checked(text: str) -> float:
        with suppress(ValueError):
            if 0 < float(text) <= most and float(text) < inf:
                return float(text)
        raise ArgumentTypeError(f'"{text}" is not a time: {right}')

    return checked


def point_in_time(text: str) -> datetime:
    """A time as ISO 8601, of this machine's zone if it names none; of two times that the clock shows
    twice, the first."""
    try:
        return datetime.fromisoformat(text).astimezone()
    except (ValueError, OverflowError, OSError):
        raise ArgumentTypeError(f'"{text}" is not a time, like 2027-01-20T10:00') from None


def _digits(text: str) -> int:
    """-1 for anything else."""
    return int(text) if text.isascii() and text.isdigit() else -1


# The data folder of a panel that a command works on: by `--data`, `--panel`, else by the settings.


def add_data_folder(parser: Parser) -> None:
    """--data, --panel."""
    parser.add_argument("--data", metavar="FOLDER", help="the data folder (KIOSK_DATA)")
    parser.add_argument("--panel", metavar="PANEL", help="the panel whose data folder it is")


def data_folder(options: Any) -> Path:
    """That of a server that was started with these options and settings. The panel file is read only if
    it decides which: one with a fault, a KioskError, does not matter else."""
    settings = Settings.from_environment({**os.environ, **environment(options)})
    if settings.data is not None:
        return settings.data
    from app.panel import load_panel  # takes half of a command's time, and is seldom needed

    return settings.data_folder(settings.mode or load_panel(settings.panel).mode)

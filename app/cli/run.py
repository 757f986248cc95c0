"""`operator-panel run [PANEL]`: the HTTP server, with the limits of `app.web.serving`.

An option is the same as the variable of the environment that is named with it, and goes before it.
Exit status: 1 or 3 it could not start, 2 a mistake on the command line.
"""

import os
import sys
from argparse import ArgumentTypeError
from collections.abc import Mapping, Sequence
from pathlib import Path

import uvicorn

from app.cli.parser import Parser
from app.errors import KioskError
from app.process.listen_sockets import check_port_free
from app.settings import LOG_LEVELS, Settings
from app.web.serving import OPTIONS

PROG = "python -m app.cli run"
HIGHEST_PORT = 65_535
VARIABLES: Mapping[str, str] = {
    "panel": "KIOSK_PANEL",
    "zenoh": "KIOSK_ZENOH",
    "mode": "KIOSK_MODE",
    "data": "KIOSK_DATA",
    "names": "KIOSK_HOSTS",
    "proxies": "KIOSK_PROXIES",
    "log_level": "KIOSK_LOG_LEVEL",
}


def main(arguments: Sequence[str], prog: str = PROG) -> int:
    parser = make_parser(prog)
    given = parser.parse_args(arguments)
    if (given.ssl_certfile is None) != (given.ssl_keyfile is None):
        parser.error("--ssl-certfile and --ssl-keyfile are given together")
    try:
        for file in filter(None, (given.ssl_certfile, given.ssl_keyfile)):
            _readable(file)
        os.environ.update(_environment(vars(given)))
        Settings.from_environment()
        check_port_free(given.host, given.port)
    except (KioskError, OSError) as error:
        print(error, file=sys.stderr)
        return 1
    uvicorn.run(
        "app.main:app",
        host=given.host,
        port=given.port,
        ssl_certfile=given.ssl_certfile,
        ssl_keyfile=given.ssl_keyfile,
        **OPTIONS,
    )
    return 0


def _environment(given: Mapping[str, object]) -> dict[str, str]:
    """The variables of the options that were given; several names are one list."""
    found = {}
    for option, variable in VARIABLES.items():
        value = given[option]
        if value is not None:
            found[variable] = ",".join(value) if isinstance(value, list) else str(value)
    return found


def _readable(file: Path) -> None:
    """Raises OSError that names the file."""
    with file.open("rb"):
        pass


def _port(text: str) -> int:
    port = int(text) if text.isascii() and text.isdigit() else -1
    if not 0 <= port <= HIGHEST_PORT:
        raise ArgumentTypeError(
            f'"{text}" is not a port: 1 to {HIGHEST_PORT}, or 0 for any that is free'
        )
    return port


def make_parser(prog: str) -> Parser:
    parser = Parser(
        prog=prog,
        description="Serves a panel to browsers.",
        epilog="`uvicorn app.main:app` serves the same, with all of uvicorn's own options.",
    )
    add = parser.add_argument
    add(
        "panel",
        nargs="?",
        metavar="PANEL",
        help="the panel file; without one that of KIOSK_PANEL, else the shipped one",
    )
    add("--host", default="127.0.0.1", help="address to listen on; default: %(default)s")
    add("--port", default=8000, type=_port, help="default: %(default)s")
    add("--mode", choices=("demo", "live"), help="instead of what the panel file says (KIOSK_MODE)")
    add("--zenoh", metavar="FILE", help="Zenoh configuration (KIOSK_ZENOH)")
    add("--data", metavar="FOLDER", help="where the operator's log and recordings are (KIOSK_DATA)")
    add(
        "--name",
        action="append",
        dest="names",
        metavar="NAME",
        help="a name or address by which browsers reach the panel, beside localhost; may be given"
        " several times (KIOSK_HOSTS)",
    )
    add(
        "--proxy",
        action="append",
        dest="proxies",
        metavar="ADDRESS",
        help="a proxy that is believed whom it speaks for; may be given several times (KIOSK_PROXIES)",
    )
    add("--log-level", choices=LOG_LEVELS, help="default: info (KIOSK_LOG_LEVEL)")
    add("--ssl-certfile", type=Path, metavar="FILE", help="for HTTPS: the certificate")
    add("--ssl-keyfile", type=Path, metavar="FILE", help="for HTTPS: its key")
    return parser

"""`operator-panel run [PANEL]`: the HTTP server, with the limits of `app.web.server`.

An option is the same as the variable of the environment that is named with it, and goes before it.
Exit status: 1 or 3 it could not start, 2 a mistake on the command line.
"""

import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import uvicorn

from app.system.errors import KioskError, SettingsError
from app.system.process.listen_sockets import check_port_free
from app.system.settings import LOG_LEVELS, PROTECTIONS, Settings
from app.tools.cli.arguments import add_settings, environment, port_to_listen
from app.tools.cli.parser import Parser
from app.web.server import OPTIONS

PROG = "python -m app.cli run"


def main(arguments: Sequence[str], prog: str = PROG) -> int:
    parser = make_parser(prog)
    return serve(parser, parser.parse_args(arguments))


def serve(parser: Parser, options: Any) -> int:
    """Serves with these options until it is ended; the exit status."""
    if (options.ssl_certfile is None) != (options.ssl_keyfile is None):
        parser.error("--ssl-certfile and --ssl-keyfile are given together")
    try:
        if options.ssl_certfile is not None:
            _check_pair(options.ssl_certfile, options.ssl_keyfile)
        os.environ.update(environment(options))
        Settings.from_environment()
        check_port_free(options.host, options.port)
    except (KioskError, OSError) as error:
        print(error, file=sys.stderr)
        return 1
    uvicorn.run(
        "app.main:app",
        host=options.host,
        port=options.port,
        ssl_certfile=options.ssl_certfile,
        ssl_keyfile=options.ssl_keyfile,
        **OPTIONS,
    )
    return 0


def _check_pair(certificate: Path, key: Path) -> None:
    """SettingsError if the files can't be used for TLS. Imported only with TLS, for a faster start."""
    from app.system.certificates import pair_fault

    if fault := pair_fault(certificate, key):
        raise SettingsError(fault)


def make_parser(prog: str) -> Parser:
    parser = Parser(
        prog=prog,
        description="Serves a panel to browsers.",
        epilog="`uvicorn app.main:app` serves the same, with all of uvicorn's own options.",
    )
    add_settings(parser)
    add_server(parser)
    return parser


def add_server(parser: Parser) -> None:
    """Where and how it is served: --host, --port, --name, …"""
    add = parser.add_argument
    add("--host", default="127.0.0.1", help="address to listen on; default: %(default)s")
    add("--port", default=8000, type=port_to_listen, help="default: %(default)s")
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
        help="address of a trusted proxy: its X-Forwarded-For counts; may be given several times"
        " (KIOSK_PROXIES)",
    )
    add(
        "--root-path",
        metavar="PATH",
        help="the path below which a proxy shows the panel, such as /cell1 (KIOSK_ROOT_PATH)",
    )
    add(
        "--without",
        action="append",
        choices=PROTECTIONS,
        help="listen beyond this machine without TLS or without users, as behind a proxy of your own"
        " (KIOSK_WITHOUT)",
    )
    add("--log-level", choices=LOG_LEVELS, help="default: info (KIOSK_LOG_LEVEL)")
    add("--ssl-certfile", type=Path, metavar="FILE", help="for HTTPS: the certificate")
    add("--ssl-keyfile", type=Path, metavar="FILE", help="for HTTPS: its key")

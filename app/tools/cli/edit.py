"""`operator-panel edit PANEL`: the editor of a panel file, in the browser.

Exit status: 0 it was ended, 1 it can't be started, 2 a mistake on the command line.
"""

import logging
import secrets
import socket
import sys
from argparse import ArgumentTypeError, Namespace
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from importlib.util import find_spec
from ipaddress import ip_address
from pathlib import Path
from types import FrameType
from typing import Final

from app.system.errors import KioskError, SettingsError
from app.system.settings import Settings, panel_path
from app.tools.cli.arguments import port_to_listen
from app.tools.cli.parser import Parser

PROG: Final = "python -m app.cli edit"
NEEDED: Final = "tomlrt"
NOT_INSTALLED: Final = (
    'the editor needs the extra "edit": pip install "operator-panel[edit]", or pip install tomlrt'
)
LANGUAGES: Final = ("en", "ja", "de")


def main(arguments: Sequence[str], prog: str = PROG) -> int:
    parser = make_parser(prog)
    options = parser.parse_args(arguments)
    if options.panel is None:
        parser.error(_no_file(prog))
    if (options.ssl_certfile is None) != (options.ssl_keyfile is None):
        parser.error("--ssl-certfile and --ssl-keyfile are given together")
    if find_spec(NEEDED) is None:
        print(NOT_INSTALLED, file=sys.stderr)
        return 1
    try:
        options.users = _checked_users(options)
        settings = Settings.from_environment()
        return _serve(options, settings)
    except (KioskError, OSError) as error:
        print(error, file=sys.stderr)
        return 1


def _checked_users(options: Namespace) -> Path | None:
    """The folder of the users who may sign in; None where no one needs to. SettingsError if the file
    can't be edited, or its editor would be open to the network."""
    path, host = options.panel, options.host
    if not path.is_file() and (path.exists() or not path.parent.is_dir()):
        raise SettingsError(f"{path}: there is no such file")
    if _is_loopback(host):
        if options.users is not None:
            raise SettingsError("--users goes with --host: no one signs in on this machine")
        return None
    if options.ssl_certfile is None:
        raise SettingsError(
            f"to listen on {host}, beyond this machine, the editor needs TLS (--ssl-certfile and"
            " --ssl-keyfile): its address has a secret. Listen on 127.0.0.1, and reach it by ssh -L"
        )
    from app.tools.editor.session import state_folder
    from app.tools.editor.signin import USERS, check_engineer

    folder: Path = (options.users or state_folder(path) / USERS).resolve()
    check_engineer(folder, host)
    return folder


def _is_loopback(host: str) -> bool:
    infos = socket.getaddrinfo(host or None, None, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
    return all(ip_address(str(info[4][0]).partition("%")[0]).is_loopback for info in infos)


def _no_file(prog: str) -> str:
    """What to type instead: the panel files of this folder, else a new one."""
    from app.tools.editor.start import panels_in

    names = [*panels_in(Path.cwd())]
    if not names:
        return f"the panel file is missing: `{prog} cell1.toml` begins one of this name"
    return f"the panel file is missing: here is {', '.join(names)}; another name begins a new one"


def _serve(options: Namespace, settings: Settings) -> int:
    """Serves until it is ended. Imported here: the help needs no server."""
    import uvicorn

    from app.tools.editor.server import editor_app
    from app.web.server import OPTIONS

    family = socket.AF_INET6 if ":" in options.host else socket.AF_INET
    listening = socket.create_server((options.host, options.port), family=family)
    port, token = listening.getsockname()[1], secrets.token_urlsafe(24)
    name = f"[{options.host}]" if ":" in options.host else options.host
    if not _is_loopback(options.host):
        settings = replace(settings, hosts=(*settings.hosts, name.lower()))
    options.panel.touch()
    app = editor_app(
        options.panel,
        settings,
        token=token,
        port=port,
        is_live=options.live,
        language=options.language or "",
        users=options.users,
    )
    scheme = "https" if options.ssl_certfile else "http"
    print(f"{scheme}://{name}:{port}/?token={token}", flush=True)
    print("Open this address in a browser. Ctrl-C ends the editor.", file=sys.stderr)

    class Server(uvicorn.Server):
        def handle_exit(self, sig: int, frame: FrameType | None) -> None:
            # Streams that this cuts off are no errors.
            logging.getLogger("uvicorn.error").disabled = True
            super().handle_exit(sig, frame)

    server = Server(
        uvicorn.Config(
            app,
            ssl_certfile=options.ssl_certfile,
            ssl_keyfile=options.ssl_keyfile,
            log_level="warning",
            timeout_graceful_shutdown=1,
            **OPTIONS,
        )
    )
    with suppress(KeyboardInterrupt):  # uvicorn has ended by then
        server.run(sockets=[listening])
    return 0


def make_parser(prog: str) -> Parser:
    parser = Parser(
        prog=prog,
        description="Edits a panel file in the browser: prints the address to open. The file stays as"
        " it was written, with its comments.",
    )
    add = parser.add_argument
    about = "the panel file; one that is not there is begun"
    add("panel", metavar="PANEL", type=_panel, nargs="?", help=about)
    add("--host", default="127.0.0.1", help="address to listen on; default: %(default)s")
    add("--port", default=8100, type=port_to_listen, help="default: %(default)s; 0: one that is free")
    add(
        "--live",
        action="store_true",
        help="show the real robot's values (KIOSK_ZENOH), which is only read; default: a simulated one",
    )
    add("--language", choices=LANGUAGES, help="of the editor; default: the browser's")
    about = "beyond this machine: the folder of the users who sign in; default: one beside the backups"
    add("--users", type=Path, metavar="FOLDER", help=about)
    add("--ssl-certfile", type=Path, metavar="FILE", help="for HTTPS: the certificate")
    add("--ssl-keyfile", type=Path, metavar="FILE", help="for HTTPS: its key")
    return parser


def _panel(name: str) -> Path:
    if not name:
        raise ArgumentTypeError("the name of a panel file is missing")
    return panel_path(name).resolve()

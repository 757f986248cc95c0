"""`operator-panel pki new | add | renew | list FOLDER`: the certificates of a cell's Zenoh network.

Exit status: 0 done, 1 something could not be read or written, or a certificate runs out within 30 days
(`list`), 2 a mistake on the command line or a panel with faults.
"""

import sys
from argparse import ArgumentTypeError
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, Final

from app.panel import load_panel
from app.system.certificates import (
    AUTHORITY,
    CA_DAYS,
    DAYS,
    PUBLIC,
    CertificateError,
    CertificateFolder,
    Holder,
    Purpose,
    write_new,
)
from app.system.errors import KioskError
from app.system.settings import Settings
from app.tools.cell_config.access_rules import over_tls
from app.tools.cli.arguments import PANEL_HELP
from app.tools.cli.parser import Parser
from app.tools.cli.peer_config import HERE, PORT, cell_holders, hosts_of, kiosk_config

PROG: Final = "python -m app.cli pki"
SOON_DAYS: Final = 30.0
CONFIG: Final = "zenoh.json5"


def main(arguments: Sequence[str], prog: str = PROG) -> int:
    options = make_parser(prog).parse_args(arguments)
    try:
        return int(options.run(options, CertificateFolder(options.folder.resolve())))
    except CertificateError as error:
        print(error, file=sys.stderr)
        return 1
    except KioskError as error:
        print(error, file=sys.stderr)
        return 2


def _new(options: Any, folder: CertificateFolder) -> int:
    file = options.panel or Settings.from_environment().panel
    panel = load_panel(file)
    cell = options.cell or file.stem
    hosts = [*options.hosts, *hosts_of(options.connect)]
    config = folder.path / CONFIG
    if config.exists():
        raise CertificateError(f"{config} exists, and is not replaced: name another folder")
    _print(folder.make(f"{cell} CA", cell_holders(panel, cell, hosts), options.request))
    named = [end for entry in panel.robots for end in entry.connect]
    endpoints = options.connect or named or [f"tls/{(hosts or HERE)[0]}:{PORT}"]
    write_new(config, kiosk_config(folder, endpoints).encode(), PUBLIC)
    _print([config])
    if plain := [end for end in named if end.startswith("tcp/")]:
        print(f"in {file}, `connect` must be over TLS: {', '.join(over_tls(plain))}")
    if options.request:
        print(
            f"the plant's CA makes NAME.pem of each NAME.csr; put them, and its own certificate as"
            f" {AUTHORITY}.pem, into {folder.path}"
        )
    else:
        print(f"keep {folder.key(AUTHORITY)} on no machine of the cell: who has it can be any of them")
    return 0


def _add(options: Any, folder: CertificateFolder) -> int:
    purpose: Purpose = "client" if options.client else "server"
    hosts = () if options.client else tuple(dict.fromkeys((*options.hosts, *HERE)))
    holder = Holder(options.common_name or options.name, purpose, hosts)
    _print(folder.add(options.name, holder, options.request))
    return 0


def _renew(options: Any, folder: CertificateFolder) -> int:
    _print(folder.renew(options.names, options.request))
    return 0


def _list(_: Any, folder: CertificateFolder) -> int:
    listed = folder.listed()
    for each in listed:
        until = each.until.strftime("%Y-%m-%d")
        left = f"{each.days:.0f} days" if each.days > 0 else "has run out"
        print(f"{each.file.name}  {each.name}  until {until}  {left}")
    return int(any(each.days < SOON_DAYS for each in listed))


def _print(files: Iterable[Path]) -> None:
    for file in files:
        print(file)


def _file_name(text: str) -> str:
    if not text.replace("-", "").replace("_", "").isalnum() or not text.isascii() or text == AUTHORITY:
        raise ArgumentTypeError(f'"{text}" is not a name of files: letters, digits, "-" and "_"')
    return text


def make_parser(prog: str) -> Parser:
    parser = Parser(
        prog=prog,
        description="The certificates of a panel, its bridge and its router, by a CA of their own or by"
        " the plant's.",
        epilog=f"A certificate is valid for {DAYS} days, that of the CA for {CA_DAYS}.",
    )
    commands = parser.add_subparsers(metavar="COMMAND", required=True)
    new = commands.add_parser("new", help="make a CA, the certificates of a panel, and its zenoh.json5")
    add = commands.add_parser("add", help="make one more certificate")
    renew = commands.add_parser("renew", help="make certificates again, for the same keys")
    listed = commands.add_parser("list", help="list the certificates, and when they run out")
    for command in (new, add, renew, listed):
        command.add_argument("folder", type=Path, metavar="FOLDER", help="where they are")
    for command in (new, add, renew):
        command.add_argument(
            "--request", action="store_true", help="requests (CSR) for the plant's CA, no certificates"
        )
    for command in (new, add):
        command.add_argument(
            "--host",
            action="append",
            dest="hosts",
            default=[],
            metavar="HOST",
            help="a name or address of the bridge's machine, beside localhost; may be given several"
            " times",
        )
    new.add_argument("--panel", type=Path, metavar="PANEL", help=PANEL_HELP)
    new.add_argument("--cell", metavar="NAME", help="before each name; default: that of the panel file")
    new.add_argument(
        "--connect",
        action="append",
        default=[],
        metavar="ENDPOINT",
        help="where the panel connects, such as tls/192.0.2.10:7447; default: `connect` in the panel"
        " file, else the first --host",
    )
    add.add_argument("name", type=_file_name, metavar="NAME", help="the name of the files")
    add.add_argument("--common-name", metavar="NAME", help="in the certificate; default: NAME")
    add.add_argument("--client", action="store_true", help="for who connects; else for who listens")
    renew.add_argument("names", nargs="*", metavar="NAME", help="which; default: all but the CA's")
    for command, run in ((new, _new), (add, _add), (renew, _renew), (listed, _list)):
        command.set_defaults(run=run)
    return parser

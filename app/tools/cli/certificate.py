"""`operator-panel certificate FOLDER`: the certificate of the panel's own server, signed by itself or
by the plant's CA.

Exit status: 0 done, 1 something could not be read or written, 2 a mistake on the command line.
"""

import socket
import sys
from argparse import ArgumentTypeError
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from app.system.certificates import CertificateError, CertificateFolder, Holder
from app.tools.cli.parser import Parser
from app.tools.cli.peer_config import HERE

PROG: Final = "python -m app.cli certificate"
NAME: Final = "panel"
DAYS: Final = 397  # browsers refuse longer ones of public CAs
MOST_DAYS: Final = 3650


def main(arguments: Sequence[str], prog: str = PROG) -> int:
    options = make_parser(prog).parse_args(arguments)
    folder = CertificateFolder(options.folder.resolve())
    try:
        if options.renew:
            print(folder.renew_own(NAME, options.days, options.request))
        else:
            _make(folder, options)
    except CertificateError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


def _make(folder: CertificateFolder, options: Any) -> None:
    hosts = options.hosts or [socket.gethostname()]
    holder = Holder(options.common_name or hosts[0], "server", tuple(dict.fromkeys((*hosts, *HERE))))
    folder.create()
    if options.request:
        files = folder.add(NAME, holder, by_plant=True)
    else:
        files = folder.self_sign(NAME, holder, options.days)
    for file in files:
        print(file)
    certificate = folder.certificate(NAME)
    if options.request:
        print(f"the plant's CA makes {certificate.name} of {files[1].name}: put it into {folder.path},")
        print("followed in the same file by the certificates between it and the CA's own")
    else:
        print(f"browsers have to trust {certificate}: import it there")
    print(f"then: operator-panel run --ssl-certfile {certificate} --ssl-keyfile {folder.key(NAME)}")


def _days(text: str) -> int:
    if not text.isascii() or not text.isdigit() or not 0 < int(text) <= MOST_DAYS:
        raise ArgumentTypeError(f'"{text}" is not a number of days from 1 to {MOST_DAYS}')
    return int(text)


def make_parser(prog: str) -> Parser:
    parser = Parser(
        prog=prog,
        description="Makes the key and the certificate of the panel's server, for HTTPS.",
        epilog="A running server takes a renewed certificate by itself, within some seconds.",
    )
    add = parser.add_argument
    add("folder", type=Path, metavar="FOLDER", help=f"where {NAME}.key and {NAME}.pem are put")
    add(
        "--host",
        action="append",
        dest="hosts",
        default=[],
        metavar="HOST",
        help="a name or address by which browsers reach the panel, beside localhost; may be given"
        " several times; default: the name of this machine",
    )
    add("--common-name", metavar="NAME", help="in the certificate; default: the first host")
    add("--days", type=_days, default=DAYS, help="how long it is valid; default: %(default)s")
    add("--request", action="store_true", help=f"a request ({NAME}.csr) for the plant's CA")
    add("--renew", action="store_true", help="make it again for the same key and hosts")
    return parser

"""`operator-panel update`: another release in place of the one that runs. Exit status: see
`app.tools.cli.install`."""

import shutil
import tempfile
from argparse import ArgumentTypeError, Namespace
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from app.system.errors import SettingsError
from app.system.minisign import PINNED, SIGNATURE_SUFFIX, check_signed, parse_keys
from app.tools.cli.install import add_root, add_wheels, exit_status, print_progress
from app.tools.cli.parser import Parser
from app.tools.install.host import Host
from app.tools.install.release import checked_wheel
from app.tools.install.update import URL, SystemdServices, Updater

PROG = "python -m app.cli update"


def main(arguments: Sequence[str], prog: str = PROG) -> int:
    parser = make_parser(prog)
    options = parser.parse_args(arguments)
    if options.back and options.wheel is not None:
        parser.error("either a wheel or --back")
    return exit_status(_update, options)


def _update(options: Namespace) -> int:
    host = Host(options.root.resolve())
    url = options.url if host.runs_systemd else None
    updater = Updater(host=host, services=SystemdServices(host), url=url, say=print_progress)
    if options.back:
        updater.back()
        return 0
    with signed_copy(checked_wheel(options.wheel), host, options.unsigned) as wheel:
        updater.update(wheel, options.wheels and options.wheels.resolve())
    return 0


@contextmanager
def signed_copy(wheel: Path, host: Host, unsigned: bool) -> Iterator[Path]:
    """A copy of the wheel that no one else can change, after its signature was checked; SettingsError
    if it is not signed with a pinned key."""
    with tempfile.TemporaryDirectory(prefix="operator-panel-update-") as folder:
        copy = Path(folder, wheel.name)
        shutil.copyfile(wheel, copy)
        if unsigned:
            print_progress(f"the signature of {wheel.name} is not checked (--unsigned)")
        else:
            print_progress(_signed_by(wheel, copy, host))
        yield copy


def _signed_by(wheel: Path, copy: Path, host: Host) -> str:
    if not host.files.is_file(PINNED):
        raise SettingsError(
            f"no key is trusted: put the public key of the releases into {PINNED}, as `minisign -G`"
            f" writes it, or give --unsigned to take {wheel.name} without a signature"
        )
    try:
        import cryptography  # noqa: F401
    except ImportError:
        raise SettingsError(
            "signatures can't be checked by this Python: run /opt/operator-panel/current/bin/"
            f"operator-panel update {wheel.name}"
        ) from None
    keys = parse_keys(host.files.read(PINNED).decode("utf-8", "replace"), PINNED)
    signature = wheel.with_name(wheel.name + SIGNATURE_SUFFIX)
    if signature.is_file():
        shutil.copyfile(signature, copy.with_name(copy.name + SIGNATURE_SUFFIX))
    return check_signed(copy, keys)


def _url(text: str) -> str:
    if not text.startswith(("http://", "https://")):
        raise ArgumentTypeError(f'"{text}" is not the address of a server, like {URL}')
    return text.rstrip("/")


def make_parser(prog: str) -> Parser:
    parser = Parser(
        prog=prog,
        description="Installs another version beside the one that runs, and starts it. If its server or"
        " page does not come up within a minute, the version of before runs again. The wheel has to be"
        " signed (minisign): its signature is the file beside it, with .minisig at the end.",
    )
    add = parser.add_argument
    add(
        "wheel",
        nargs="?",
        type=Path,
        metavar="WHEEL",
        help="of the other version; default: the wheel that this runs from",
    )
    add(
        "--unsigned",
        action="store_true",
        help=f"take a wheel whose signature matches no key in {PINNED}",
    )
    add("--back", action="store_true", help="run the version of before again")
    add("--url", type=_url, default=URL, help="where the server answers; default: %(default)s")
    add_root(parser)
    add_wheels(parser)
    return parser

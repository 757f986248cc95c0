"""`operator-panel central`: the plant's central database.

Exit status: 0 done, or nothing is wrong; 1 `verify` found a fault, or the database refuses; 2 a
mistake on the command line or in the settings.
"""

import sys
from argparse import ArgumentTypeError, Namespace
from collections.abc import Sequence
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Final

from app.cell.forward.config import STREAMS, read_central
from app.system.errors import KioskError, SettingsError
from app.tools.cli.arguments import point_in_time, whole_number
from app.tools.cli.forward import add_settings_file, settings_file
from app.tools.cli.parser import Parser

if TYPE_CHECKING:
    from app.tools.central.details import DetailRequest
    from app.tools.central.verification import PanelResult

PROG: Final = "python -m app.cli central"
LEAST_DAYS: Final = 31


def main(arguments: Sequence[str], prog: str = PROG) -> int:
    options = make_parser(prog).parse_args(arguments)
    try:
        status: int = options.run(options)
    except SettingsError as error:
        print(error, file=sys.stderr)
        return 2
    except KioskError as error:
        print(error, file=sys.stderr)
        return 1
    return status


def _upgrade(options: Namespace) -> int:
    from app.tools.central.schema import database, upgrade

    with database(read_central(settings_file(options))) as db:
        before, after, made = upgrade(db, new=options.new)
    if before == after:
        print(f"the schema has version {after} already; {made} partitions made")
    else:
        print(f"the schema has version {after}; {made} partitions made")
    return 0


def _prune(options: Namespace) -> int:
    from app.tools.central.schema import database, prune

    streams = tuple(options.stream or STREAMS)
    with database(read_central(settings_file(options))) as db:
        removed = prune(db, options.days, streams)
    for stream, count in removed.items():
        print(f"{stream}: {count} rows removed")
    return 0


def _verify(options: Namespace) -> int:
    from app.tools.central.schema import CentralError, database
    from app.tools.central.verification import panels, verify_panel

    faults = 0
    with database(read_central(settings_file(options))) as db:
        chosen = panels(db, options.panel)
        if not chosen:
            which = f'no panel "{options.panel}"' if options.panel else "no panel"
            raise CentralError(f"there is {which} at the centre")
        for panel in chosen:
            result = verify_panel(db, panel, dict(options.key or ()))
            print(_summary(result))
            for finding in result.findings:
                print(f"  {'note' if finding.is_note else 'FAULT'}: {finding}")
                faults += not finding.is_note
    print("nothing is missing or changed" if not faults else f"{faults} faults")
    return 1 if faults else 0


def _summary(result: "PanelResult") -> str:
    signed = "no entry is signed"
    if result.signed.key:
        at = datetime.fromtimestamp(result.signed.at / 1000, UTC).isoformat(timespec="seconds")
        signed = f"signed up to entry {result.signed.seq} at {at} with the key {result.signed.key}"
    retired = " (retired)" if result.panel.is_retired else ""
    return f"{result.panel.name}{retired}: {result.entries} entries of the log, {signed}"


def _ask(options: Namespace) -> int:
    from app.tools.central.details import ask, requests
    from app.tools.central.schema import database

    with database(read_central(settings_file(options))) as db:
        if options.list:
            for request in requests(db, options.panel):
                print(_line(request))
            return 0
        if not options.panel or options.since is None:
            raise SettingsError("ask needs --panel and --from, or --list")
        number = ask(db, options.panel, options.pen or (), options.since, options.until)
    print(f"request {number}: {options.panel} sends the details when it is connected (ask --list)")
    return 0


def _line(request: "DetailRequest") -> str:
    pens = ", ".join(f'"{pen}"' for pen in request.pens) or "all pens"
    result = f", {request.rows} values" if request.status == "done" else ""
    reason = f": {request.reason}" if request.reason else ""
    return (
        f"{request.number} {request.panel}: {pens} from {_seconds(request.since)} until"
        f" {_seconds(request.until)}, asked by {request.asked_by} at {_seconds(request.asked_at)}:"
        f" {request.status}{result}{reason}"
    )


def _seconds(at: datetime) -> str:
    return at.astimezone().isoformat(timespec="seconds")


def _noted_key(text: str) -> tuple[str, str]:
    from app.records.log_key import parse_public_key

    name, _, key = text.partition("=")
    try:
        return name, parse_public_key(key)
    except ValueError as error:
        raise ArgumentTypeError(f"{error}; write PANEL=KEY") from None


def make_parser(prog: str) -> Parser:
    parser = Parser(
        prog=prog,
        description="The plant's central database (PostgreSQL): its schema, verification, pruning.",
        epilog="The connection is that of [central], else [forward], of the settings' file.",
    )
    commands = parser.add_subparsers(metavar="COMMAND", required=True)
    init = commands.add_parser("init", help="make the schema, roles and partitions in a database")
    init.set_defaults(run=_upgrade, new=True)
    upgrade = commands.add_parser(
        "upgrade", help="bring the schema to this version, and make the partitions of the next year"
    )
    upgrade.set_defaults(run=_upgrade, new=False)
    verify = commands.add_parser("verify", help="check that nothing is missing or was changed")
    verify.set_defaults(run=_verify)
    verify.add_argument("--panel", default="", metavar="NAME", help="only this one")
    verify.add_argument(
        "--key",
        action="append",
        type=_noted_key,
        metavar="PANEL=KEY",
        help="a panel's public key, as `operator-panel log key` printed it at the cell; may be given"
        " several times; default: the key that the panel registered with",
    )
    prune = commands.add_parser("prune", help="remove what is old, and make the next partitions")
    prune.set_defaults(run=_prune)
    prune.add_argument(
        "--days",
        type=whole_number(LEAST_DAYS),
        required=True,
        help=f"what is older goes; from {LEAST_DAYS} on",
    )
    prune.add_argument(
        "--stream", action="append", choices=STREAMS, help="only of this one; default: of all"
    )
    ask = commands.add_parser(
        "ask", help="ask a panel for the seconds of its trends, which stay in the cell otherwise"
    )
    ask.set_defaults(run=_ask)
    ask.add_argument("--panel", default="", metavar="NAME", help="of which panel")
    ask.add_argument(
        "--from", dest="since", type=point_in_time, metavar="TIME", help="such as 2027-01-20T10:00"
    )
    ask.add_argument("--until", type=point_in_time, metavar="TIME", help="default: now")
    ask.add_argument(
        "--pen",
        action="append",
        metavar="TOPIC",
        help='a topic, or a topic and a field ("/speed data"); may be given several times;'
        " default: all pens",
    )
    ask.add_argument("--list", action="store_true", help="show the newest requests and their results")
    for command in (init, upgrade, verify, prune, ask):
        add_settings_file(command)
    return parser

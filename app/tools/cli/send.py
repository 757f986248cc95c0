"""`operator-panel send PANEL --to URL`: sends a panel file with its files to a kiosk.

The kiosk's own check and the difference are printed first. The token comes from a file, from standard
input or from the environment, never from the command line. Exit status: 0 the kiosk shows it, 1 it does
not, 2 a mistake on the command line.
"""

import asyncio
import sys
from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from app.system.errors import KioskError, SettingsError
from app.system.settings import panel_path
from app.system.texts import render
from app.tools.cli.arguments import TOKEN, add_kiosk, kiosk_token
from app.tools.cli.parser import Parser

PROG: Final = "python -m app.cli send"


def main(arguments: Sequence[str], prog: str = PROG) -> int:
    options = make_parser(prog).parse_args(arguments)
    try:
        return asyncio.run(_send(options, _token(options)))
    except KioskError as error:
        print(render(error.text), file=sys.stderr)
        return 1


def _token(options: Namespace) -> str:
    """SettingsError if there is none."""
    if (token := kiosk_token(options)) is None:
        raise SettingsError(f"an engineer's token is needed: --token-file FILE, or {TOKEN}")
    return token


async def _send(options: Namespace, token: str) -> int:
    """Imported here: the help needs no client."""
    from app.tools.editor.sending import Destination, Sending

    sending = Sending(options.panel, lambda: None)
    to = Destination(address=options.to, token=token, trust=options.trust)
    await sending.compare(to, "en")
    if not sending.check:
        print(render(sending.problem), file=sys.stderr)
        return 1
    check, kiosk = sending.check, sending.kiosk
    print(f'{options.to}: "{kiosk["title"]}", version {kiosk["version"]}')
    for remark in check["faults"]:
        print(f"  {remark['place']}, line {remark['line']}: {remark['message']}")
    for remark in check["notes"]:
        print(f"  note: {remark['place']}: {remark['message']}")
    for change in check["files"]:
        print(f"  {change['change']}: {change['name']}")
    print(check["diff"], end="", flush=True)
    if check["faults"]:
        return 1
    if check["sent"] == check["compared"]:
        print("The kiosk has this file already.")
        return 0
    if check["refusal"]:
        print(check["refusal"], file=sys.stderr)
        return 1
    if not options.yes and not _asks():
        return 1
    await sending.send()
    await sending.finished()
    print(
        render(sending.problem or sending.result),
        file=sys.stdout if _is_shown(sending.stage) else sys.stderr,
    )
    return 0 if _is_shown(sending.stage) else 1


def _asks() -> bool:
    return sys.stdin.isatty() and input("Send it? [y/N] ").strip().lower() in ("y", "yes")


def _is_shown(stage: str) -> bool:
    return stage == "shown"


def make_parser(prog: str) -> Parser:
    parser = Parser(
        prog=prog,
        description="Sends a panel file to a kiosk that takes panel files (KIOSK_TAKE_PANEL), after its"
        " check and the difference.",
        epilog=f"The token of an engineer is in a file, or in {TOKEN}.",
    )
    add = parser.add_argument
    add("panel", metavar="PANEL", type=_panel, help="the panel file")
    add("--to", required=True, metavar="URL", help="the kiosk, such as https://panel1.local:8000")
    add_kiosk(parser)
    add("--yes", action="store_true", help="does not ask")
    return parser


def _panel(name: str) -> Path:
    return panel_path(name).resolve()

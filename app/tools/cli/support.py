"""`operator-panel support [PANEL]`: a zip of what support needs to know, listed before it is written.

Exit status: 0 written or listed, 1 it can't be written, 2 a mistake on the command line, or not wanted.
"""

import asyncio
import os
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

from app.system.errors import KioskError
from app.system.settings import Settings
from app.tools.cli.doctor import add_options, options_of, settings_of
from app.tools.cli.output import OutputError, writing
from app.tools.cli.parser import Parser
from app.tools.doctor.bundle import Part, Sources, packed, parts, write
from app.tools.doctor.doctor import Options, diagnose
from app.tools.doctor.journal import journal

ONLY: Final = "Only names, numbers, codes and times that are known to be harmless: no texts, no values."
PROG: Final = "python -m app.cli support"


def main(arguments: Sequence[str], prog: str = PROG) -> int:
    parsed = make_parser(prog).parse_args(arguments)
    file = parsed.output or Path(time.strftime("operator-panel-support-%Y%m%d-%H%M%S.zip"))
    if not parsed.list and not parsed.yes and not sys.stdin.isatty():
        print("this is no terminal to ask at: give --yes to write it, or --list", file=sys.stderr)
        return 2
    try:
        settings, options = settings_of(parsed), options_of(parsed)
        diagnosis = asyncio.run(diagnose(settings, options))
    except KioskError as error:
        print(error, file=sys.stderr)
        return 2
    made = parts(settings, options, diagnosis, Sources(environment=os.environ, journal=journal))
    print(listed(made))
    if parsed.list:
        return 0
    if not parsed.yes and not _ask_to_write(file):
        print("nothing was written")
        return 2
    try:
        with writing(file):
            size = write(file, made)
    except OutputError as error:
        print(error, file=sys.stderr)
        return 1
    print(f"{file}: {_size(size)}")
    return 0


def bundle(settings: Settings, host: str, port: int) -> Iterator[bytes]:
    """The zip for a server that listens there; KioskError if the doctor could not look."""
    options = Options(host=host, port=port)
    diagnosis = asyncio.run(diagnose(settings, options))
    sources = Sources(environment=os.environ, journal=journal)
    yield packed(parts(settings, options, diagnosis, sources))


def listed(made: Sequence[Part]) -> str:
    """What the bundle holds, a line for each file."""
    lines = [f"  {part.name:32} {_size(part.size):>8}  {part.about}" for part in made]
    return "\n".join(["The bundle holds:", *lines, ONLY])


def _size(count: int) -> str:
    return f"{count / 1000:.1f} kB" if count < 1_000_000 else f"{count / 1_000_000:.1f} MB"


def _ask_to_write(file: Path) -> bool:
    return input(f"Write {file}? [y/N] ").strip().lower() in ("y", "yes")


def make_parser(prog: str) -> Parser:
    parser = Parser(
        prog=prog,
        description="Collects what support needs to know in a zip file: panel, settings, versions, the"
        " last hour of logs, state, ROS graph, metrics and the doctor's findings, of all this only what"
        " is known to be harmless. It lists what the file holds, and asks before it writes it.",
        epilog="Exit status: 0 written or listed, 1 it can't be written, 2 a mistake on the command"
        " line, or not wanted.",
    )
    parser.add_argument(
        "-o", "--output", type=Path, metavar="FILE", help="the zip; default: one named by the time"
    )
    parser.add_argument(
        "--list", action="store_true", help="list what it would hold, and write nothing"
    )
    parser.add_argument("-y", "--yes", action="store_true", help="write it without a question")
    add_options(parser)
    return parser

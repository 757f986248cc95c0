"""`operator-panel parcel [PANEL]`: a zip for the vendor's service desk with what is known of one stop.

Exit status: 0 written, 1 it can't be written, or there is no stop, 2 a mistake on the command line, in
the settings or in the panel file.
"""

import os
import sys
import time
from argparse import ArgumentTypeError
from collections.abc import Iterator, Sequence
from datetime import datetime
from pathlib import Path
from tempfile import TemporaryFile
from typing import Final

from app.system.errors import KioskError, LogError, SettingsError
from app.system.settings import Settings
from app.tools.cli.arguments import add_settings, environment
from app.tools.cli.output import OutputError, add_force, check_absent, draft_of
from app.tools.cli.parser import Parser
from app.tools.doctor.parcel import Moment, Reach, load, moment_of, write_parcel
from app.tools.doctor.shown_pages import Taker

PROG: Final = "python -m app.cli parcel"
PIECE: Final = 256 * 1024


def main(arguments: Sequence[str], prog: str = PROG) -> int:
    options = make_parser(prog).parse_args(arguments)
    try:
        settings = Settings.from_environment({**os.environ, **environment(options)})
        panel = load(settings)
        language = options.language or panel.language
        if language not in panel.readers_languages:
            known = ", ".join(panel.readers_languages)
            raise SettingsError(f'{settings.panel} is not in the language "{language}": it has {known}')
        robots = [str(robot.id) for robot in panel.robots]
        if options.robot and options.robot not in robots:
            known = ", ".join(robots) or "one robot without a name"
            raise SettingsError(f'there is no robot "{options.robot}" in {settings.panel}: {known}')
        moment = moment_of(settings, panel, options.at, options.robot)
        name = time.strftime("fault-%Y%m%d-%H%M%S.zip", time.localtime(moment.at))
        file = options.output or Path(name)
        check_absent(file, options.force)
        with draft_of(file, options.force) as draft, draft.open("wb") as stream:
            draft.chmod(0o600)
            parcel = write_parcel(stream, settings, panel, moment, language, Reach())
    except (OutputError, LogError) as error:
        print(error, file=sys.stderr)
        return 1
    except KioskError as error:
        print(error, file=sys.stderr)
        return 2
    for name, why in parcel.left_out:
        print(f"left out: {name}: {why}", file=sys.stderr)
    print(f"{file}: {len(parcel.parts)} parts, {moment.key or 'no stop'}")
    return 0


def pieces(
    settings: Settings,
    stop: tuple[float, str, str],
    language: str,
    taker: tuple[str, frozenset[str]],
    now: bytes | None,
) -> Iterator[bytes]:
    """The zip for a server, piece by piece. `stop` is its time, robot and key, `taker` the role and the
    groups of who gets it, `now` what the pages show now."""
    with TemporaryFile() as file:
        reach = Reach(Taker(*taker), now)
        write_parcel(file, settings, load(settings), Moment(*stop), language, reach)
        file.seek(0)
        while piece := file.read(PIECE):
            yield piece


def moment(text: str) -> float:
    """The type of a time: seconds since the epoch."""
    try:
        return datetime.fromisoformat(text).timestamp()
    except (ValueError, OverflowError, OSError):
        raise ArgumentTypeError(f'"{text}" is not a time, like 2027-01-20T10:00:31') from None


def make_parser(prog: str) -> Parser:
    parser = Parser(
        prog=prog,
        description="Writes a zip for the vendor's service desk with what is known of one stop: its"
        " story, the log and the alarms around it, the recordings, versions and hashes, the panel file"
        " without its texts, the pages as they were shown at the stop, and a layout for Lichtblick and"
        " Foxglove. It needs no running server.",
        epilog="Exit status: 0 written, 1 it can't be written, or there is no stop, 2 a mistake on the"
        " command line, in the settings or in the panel file.",
    )
    add = parser.add_argument
    add_settings(parser)
    add(
        "--at",
        type=moment,
        metavar="TIME",
        help="the stop nearest to it, like 2027-01-20T10:00:31, in this machine's zone if it has none;"
        " default: the newest stop of the last seven days",
    )
    add("--robot", default="", metavar="ID", help="of several robots; default: any")
    add("--language", metavar="TAG", help="such as de; default: that of the panel file")
    add("-o", "--output", type=Path, metavar="FILE", help="the zip; default: one named by the time")
    add_force(parser)
    return parser

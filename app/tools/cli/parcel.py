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
from app.tools.cli.arguments import add_settings, environment, port
from app.tools.cli.output import OutputError, add_force, check_absent, draft_of
from app.tools.cli.parser import Parser
from app.tools.doctor.parcel import Moment, Server, load, moment_of, write_parcel

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
        server = Server(host=options.host, port=options.port)
        with draft_of(file, options.force) as draft, draft.open("wb") as stream:
            draft.chmod(0o600)
            parcel = write_parcel(stream, settings, panel, moment, language, server)
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
    settings: Settings, host: str, port: int, at: float, key: str, robot: str, language: str
) -> Iterator[bytes]:
    """The zip for a server that listens there, piece by piece."""
    with TemporaryFile() as file:
        server = Server(host=host, port=port)
        write_parcel(file, settings, load(settings), Moment(at, robot, key), language, server)
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
        " without its texts, and a layout for Lichtblick and Foxglove. It needs no running server; of"
        " one it has the page that is shown now.",
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
    add("--host", default="127.0.0.1", help="where the server listens; default: %(default)s")
    add("--port", default=8000, type=port, help="default: %(default)s")
    add("-o", "--output", type=Path, metavar="FILE", help="the zip; default: one named by the time")
    add_force(parser)
    return parser

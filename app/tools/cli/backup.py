"""`operator-panel backup [FILE]`: the data and the panel file of a panel in one zip, also while its
server runs.

Exit status: 0 written and checked, 1 it can't be written or what is there is damaged, 2 a mistake on
the command line, or in the settings or the panel file.
"""

import os
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from app.system.errors import KioskError
from app.system.settings import Settings
from app.tools.cli.arguments import data_folder, environment
from app.tools.cli.log import public_key
from app.tools.cli.output import OutputError, add_force, check_absent, draft_of
from app.tools.cli.parser import Parser
from app.tools.install.backup import BackupError, Check, make_backup

PROG: Final = "python -m app.cli backup"


def main(arguments: Sequence[str], prog: str = PROG) -> int:
    options = make_parser(prog).parse_args(arguments)
    file = options.file or Path(time.strftime("operator-panel-backup-%Y%m%d-%H%M%S.zip"))
    try:
        data = data_folder(options)
        settings = Settings.from_environment({**os.environ, **environment(options)})
        check_absent(file, options.force)
        with draft_of(file, options.force) as draft:
            made = make_backup(
                data,
                None if options.data_only else settings.panel,
                draft,
                recordings=options.recordings,
                check=Check(tuple(options.key), not options.unverified),
            )
    except (OutputError, BackupError) as error:
        print(f"no backup was written: {error}", file=sys.stderr)
        return 1
    except KioskError as error:
        print(error, file=sys.stderr)
        return 2
    print(f"{file}: {made.files} files, {made.size / 1e6:.1f} MB, {made.entries} entries of the log")
    print("it has the key of the log and the hashes of PINs: keep it where only you can read it")
    return 0


def add_check(parser: Parser) -> None:
    """--key, --unverified."""
    parser.add_argument(
        "--key",
        action="append",
        default=[],
        type=public_key,
        metavar="KEY",
        help="a public key that may sign the log, as of `log verify`; default: that of the data folder",
    )
    parser.add_argument(
        "--unverified", action="store_true", help="also a log that was changed, as evidence of that"
    )


def make_parser(prog: str) -> Parser:
    parser = Parser(
        prog=prog,
        description="Writes the data folder of a panel, and the panel file with what it names, to a"
        " zip; the server may run. Databases and the log's chain are checked before it is there.",
        epilog="Exit status: 0 written and checked, 1 it can't be written or what is there is damaged,"
        " 2 a mistake on the command line, or in the settings or the panel file.",
    )
    parser.add_argument(
        "file", nargs="?", type=Path, metavar="FILE", help="default: one named by the time"
    )
    parser.add_argument("--panel", metavar="PANEL", help="the panel file (KIOSK_PANEL)")
    parser.add_argument("--data", metavar="FOLDER", help="the data folder (KIOSK_DATA)")
    parser.add_argument("--recordings", action="store_true", help="with the recordings")
    parser.add_argument("--data-only", action="store_true", help="without the panel file")
    add_check(parser)
    add_force(parser)
    return parser

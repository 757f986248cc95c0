"""`operator-panel restore FILE`: puts the data of a backup in place; the old data is kept beside it.

Exit status: 0 restored, 1 it can't be, and nothing was changed, 2 a mistake on the command line or in
the settings.
"""

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from app.system.errors import FolderInUse, KioskError
from app.tools.cli.arguments import add_data_folder, data_folder
from app.tools.cli.backup import add_check
from app.tools.cli.parser import Parser
from app.tools.install.backup import BackupError, Check, restore, write_panel

PROG: Final = "python -m app.cli restore"


def main(arguments: Sequence[str], prog: str = PROG) -> int:
    options = make_parser(prog).parse_args(arguments)
    try:
        if options.panel_to is not None:
            print(f"the panel file: {write_panel(options.file, options.panel_to)}")
            return 0
        data = data_folder(options)
        done = restore(options.file, data, Check(tuple(options.key), not options.unverified))
    except (BackupError, FolderInUse) as error:
        print(f"nothing was restored: {error}", file=sys.stderr)
        return 1
    except KioskError as error:
        print(error, file=sys.stderr)
        return 2
    except OSError as error:
        name = error.filename or options.file
        print(f"nothing was restored: {name}: {error.strerror}", file=sys.stderr)
        return 1
    print(f"{data}: {done.made.files} files, {done.made.entries} entries of the log")
    if done.aside is not None:
        print(f"the old data is in {done.aside}")
    return 0


def make_parser(prog: str) -> Parser:
    parser = Parser(
        prog=prog,
        description="Puts the data of a backup in the place of a panel's data folder, after everything"
        " in it is checked. The server must not run; the old data is kept beside it.",
        epilog="Exit status: 0 restored, 1 it can't be, and nothing was changed, 2 a mistake on the"
        " command line or in the settings.",
    )
    parser.add_argument("file", type=Path, metavar="FILE", help="as `backup` has written it")
    add_data_folder(parser)
    parser.add_argument(
        "--panel-to",
        type=Path,
        metavar="FOLDER",
        help="write the panel file and what it names into this new folder, and restore no data",
    )
    add_check(parser)
    return parser

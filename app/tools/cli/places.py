"""`operator-panel places list|export`: the places that operators saved, without a browser.

`export` prints them as a part of a panel file. Exit status: 0 done, 1 the output is there already, 2
the panel file or the saved places can't be read.
"""

import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from app.cell.places.saved import SavedPlaces, places_text
from app.cell.session.place_file import NAME, read_saved
from app.panel import load_panel
from app.system.errors import KioskError
from app.system.settings import Settings
from app.system.texts import render
from app.tools.cli.arguments import add_settings, environment
from app.tools.cli.output import OutputError, add_force, check_absent, draft_of
from app.tools.cli.parser import Parser

PROG: Final = "python -m app.cli places"


def main(arguments: Sequence[str], prog: str = PROG) -> int:
    options = make_parser(prog).parse_args(arguments)
    try:
        data, saved = _saved(options)
        status: int = options.run(options, data, saved)
    except OutputError as error:
        print(error, file=sys.stderr)
        return 1
    except (KioskError, OSError) as error:
        print(error, file=sys.stderr)
        return 2
    return status


def _saved(options: Any) -> tuple[Path, SavedPlaces]:
    """The data folder, and the places that it has."""
    settings = Settings.from_environment({**os.environ, **environment(options)})
    data = settings.data_folder(settings.mode or load_panel(settings.panel).mode)
    saved = read_saved(data)
    if saved.fault:
        raise KioskError(f"{data / NAME}: {render(saved.fault)}")
    return data, saved


def _list(_: Any, data: Path, saved: SavedPlaces) -> int:
    print(f"{len(saved.places)} in {data / NAME}")
    for place in saved.places:
        where = f"x {place.x:.2f} m, y {place.y:.2f} m, yaw {place.yaw:.2f}"
        print(f"  {place.id}  {render(place.label)}  {where}, map {place.map_version}")
    return 0


def _export(options: Any, _: Path, saved: SavedPlaces) -> int:
    text = places_text(saved.places)
    if options.output is None:
        print(text, end="")
        return 0
    check_absent(options.output, options.force)
    with draft_of(options.output, options.force) as draft:
        draft.write_text(text, encoding="utf-8")
    print(f"{options.output}: {len(saved.places)} places")
    return 0


def make_parser(prog: str) -> Parser:
    parser = Parser(prog=prog, description="The places that operators saved.")
    commands = parser.add_subparsers(metavar="COMMAND", required=True)
    listed = commands.add_parser("list", help="list the saved places")
    exported = commands.add_parser("export", help="print the saved places as [[place]] tables")
    exported.add_argument("-o", "--output", type=Path, metavar="FILE", help="default: print it")
    add_force(exported)
    for command, run in ((listed, _list), (exported, _export)):
        add_settings(command)
        command.set_defaults(run=run)
    return parser

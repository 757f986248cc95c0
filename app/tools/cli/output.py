"""Files that commands write, and the progress that they show. A file that exists is kept unless --force
is given."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Final

from app.system.errors import KioskError
from app.system.whole_file import whole_file
from app.tools.cli.parser import Parser

NAME: Final = "give another name with -o"
NAME_OR_FORCE: Final = f"{NAME}, or --force to replace it"


class OutputError(KioskError):
    """A file that can't be written."""


def add_force(parser: Parser) -> None:
    parser.add_argument("--force", action="store_true", help="replace FILE if it exists")


def check_absent(file: Path, force: bool) -> None:
    """OutputError if the file exists and is not to be replaced."""
    if file.exists() and not force:
        raise OutputError(f"{file} exists: {NAME_OR_FORCE}")


@contextmanager
def writing(file: Path) -> Iterator[None]:
    """OSError of the block becomes an OutputError that names the file."""
    try:
        yield
    except FileExistsError as error:
        raise OutputError(f"{file} exists: {NAME}") from error
    except OSError as error:
        raise OutputError(f"{file} can't be written: {error.strerror}") from error


@contextmanager
def draft_of(file: Path, force: bool) -> Iterator[Path]:
    """A file beside `file` that takes its place after the block: `file` is written whole or not at all.
    OutputError if it can't be."""
    target = file.resolve()  # a link stays one
    check = partial(check_absent, file, force)
    with writing(file), whole_file(target, mode=None, durable=False, check=check) as draft:
        yield Path(draft.name)


@contextmanager
def terminal_progress(noun: str) -> Iterator[Callable[[int, int], None]]:
    """Shows "30,000 of 100,000 entries verified" on one line of a terminal, gone after the block.
    Elsewhere, as in a file or a pipe, nothing is written."""
    shown = False

    def show(count: int, total: int) -> None:
        nonlocal shown
        if sys.stderr.isatty():
            shown = True
            print(f"\r{count:,} of {total:,} {noun}", end="", file=sys.stderr, flush=True)

    try:
        yield show
    finally:
        if shown:
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)

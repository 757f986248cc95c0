"""A process of its own that reads the operator's log for the server: `run`.

A thread would take interpreter and processor from presses and holds. What is wanted comes as JSON on
the standard input (`Wish`); on the standard output comes CSV or, where a count is wanted, JSON.
Exit status: 0 all of it, 1 not: see stderr.
"""

import json
import os
import signal
import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import BinaryIO, Final, NoReturn

from app.audit.entry import Entry
from app.audit.export import csv_chunks, gzipped
from app.audit.queries import Filter, Row, rows
from app.errors import LogError
from app.i18n import ENGLISH

NICE_INCREMENT: Final = 10  # than the server, which has no time to lose


@dataclass(frozen=True, slots=True)
class ReadRequest:
    """Entries before a number, the newest first: `count` at most, or all as CSV where that is None."""

    folder: Path
    wanted: Filter
    before: int | None
    count: int | None = None
    gzip: bool = False
    language: str = ENGLISH  # of the reasons of CSV

    def as_json(self) -> bytes:
        return json.dumps(asdict(self) | {"folder": str(self.folder)}).encode()


def parse_request(text: bytes) -> ReadRequest:
    given = json.loads(text)
    folder, wanted = Path(given.pop("folder")), Filter(**given.pop("wanted"))
    return ReadRequest(folder, wanted, **given)


def parse_rows(text: bytes) -> list[Row]:
    """The entries that were wanted."""
    return [Row(Entry(*entry), pressed_at) for entry, pressed_at in json.loads(text)]


def read(wish: ReadRequest) -> Iterator[bytes]:
    """What is wanted, some at a time; LogError."""
    if wish.count is not None:
        found = rows(wish.folder, wish.wanted, wish.before, wish.count)
        yield json.dumps([(row.entry, row.pressed_at) for row in found]).encode()
        return
    pieces = csv_chunks(wish.folder, wish.wanted, wish.before, wish.language)
    yield from gzipped(pieces) if wish.gzip else pieces


def main(given: BinaryIO, out: BinaryIO) -> int:
    wish = parse_request(given.read())
    os.nice(NICE_INCREMENT)
    try:
        for piece in read(wish):
            out.write(piece)
            out.flush()
    except LogError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


def run() -> NoReturn:
    """The process."""
    signal.signal(signal.SIGPIPE, signal.SIG_DFL)  # who wanted it may go
    sys.exit(main(sys.stdin.buffer, sys.stdout.buffer))

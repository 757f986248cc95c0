"""The process that reads the operator's log for the server: `run`.

A thread would take interpreter and processor time from presses and holds. The request arrives as JSON
on stdin (`ReadRequest`); stdout gets CSV or, for a request with a count, JSON. Exit status: 0 if
complete, 1 after an error, which is on stderr.
"""

import json
import os
import signal
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import BinaryIO, Final, NoReturn

from app.audit.entry import Entry
from app.audit.export import csv_chunks, gzipped
from app.audit.queries import Filter, Row, rows
from app.errors import LogError
from app.i18n import ENGLISH

NICE_INCREMENT: Final = 10  # lower priority than the server


@dataclass(frozen=True, slots=True)
class ReadRequest:
    """A request for entries before the entry number `before`, the newest first: at most `count`, or
    with None all of them as CSV."""

    folder: Path
    wanted: Filter
    before: int | None
    count: int | None = None
    gzip: bool = False
    language: str = ENGLISH  # of the reasons in CSV

    def as_json(self) -> bytes:
        return json.dumps(asdict(self) | {"folder": str(self.folder)}).encode()


def parse_request(text: bytes) -> ReadRequest:
    fields = json.loads(text)
    folder, wanted = Path(fields.pop("folder")), Filter(**fields.pop("wanted"))
    return ReadRequest(folder, wanted, **fields)


def parse_rows(text: bytes) -> list[Row]:
    """The rows in a JSON response."""
    return [Row(Entry(*entry), pressed_at) for entry, pressed_at in json.loads(text)]


def read(request: ReadRequest) -> Iterator[bytes]:
    """The response, in chunks; LogError."""
    if request.count is not None:
        matching = rows(request.folder, request.wanted, request.before, request.count)
        yield json.dumps([(row.entry, row.pressed_at) for row in matching]).encode()
        return
    pieces = csv_chunks(request.folder, request.wanted, request.before, request.language)
    yield from gzipped(pieces) if request.gzip else pieces


def main(source: BinaryIO, out: BinaryIO) -> int:
    return write(read(parse_request(source.read())), out)


def write(pieces: Iterable[bytes], out: BinaryIO) -> int:
    """Writes the response; returns the exit status."""
    with suppress(OSError):  # the unit's filter of system calls may forbid it
        os.nice(NICE_INCREMENT)
    try:
        for piece in pieces:
            out.write(piece)
            out.flush()
    except LogError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


def run() -> NoReturn:
    """The entry point of the process."""
    run_main(main)


def run_main(main: Callable[[BinaryIO, BinaryIO], int]) -> NoReturn:
    """Runs `main` on stdin and stdout."""
    signal.signal(signal.SIGPIPE, signal.SIG_DFL)  # ends the process when the server stops reading
    sys.exit(main(sys.stdin.buffer, sys.stdout.buffer))

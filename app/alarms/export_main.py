"""The process that exports the history of alarms for the server: `run`.

As `app/audit/reader_main.py`: the request arrives as JSON on stdin (`ExportRequest`), stdout gets CSV.
"""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, NoReturn

from app.alarms.export import csv_chunks
from app.alarms.history import HistoryFilter
from app.audit.export import gzipped
from app.audit.reader_main import run_main, write


@dataclass(frozen=True, slots=True)
class ExportRequest:
    """`path` is the file, None for no history; `language` is that of its texts."""

    path: Path | None
    wanted: HistoryFilter
    gzip: bool
    language: str

    def as_json(self) -> bytes:
        path = str(self.path) if self.path else None
        return json.dumps([path, list(self.wanted), self.gzip, self.language]).encode()


def parse_request(text: bytes) -> ExportRequest:
    path, wanted, gzip, language = json.loads(text)
    return ExportRequest(Path(path) if path else None, HistoryFilter(*wanted), gzip, language)


def export(request: ExportRequest) -> Iterator[bytes]:
    """The CSV in chunks; LogError."""
    pieces = csv_chunks(request.path, request.wanted, request.language)
    return gzipped(pieces) if request.gzip else pieces


def main(source: BinaryIO, out: BinaryIO) -> int:
    return write(export(parse_request(source.read())), out)


def run() -> NoReturn:
    """The entry point of the process."""
    run_main(main)

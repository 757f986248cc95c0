"""`operator-panel log`: the operator's log of a server, also while it runs.

`log verify`: exit status 0 nothing was changed, 1 an entry was changed, removed, reordered or inserted,
2 the log can't be read. `log panel`: 1 if the log or the kept files have no answer, 0 and 2 as above.
`log export`: 1 if the file can't be written, 0 and 2 as above.
"""

import sys
import time
from argparse import ArgumentTypeError, Namespace
from collections.abc import Iterator, Sequence
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from app.records.copy import Comparison, read_copy
from app.records.database import Filter, as_log_error, entry_count, open_read_only
from app.records.verify import Signed, verify
from app.system.errors import KioskError, LogError
from app.system.texts.catalogue import ENGLISH, files
from app.system.whole_file import whole_file
from app.tools.cli.arguments import add_data_folder, data_folder, point_in_time
from app.tools.cli.output import terminal_progress
from app.tools.cli.parser import Parser

if TYPE_CHECKING:
    from app.records.shown_panel import Run

PROG = "python -m app.log"


def main(arguments: Sequence[str], prog: str = PROG) -> int:
    options = make_parser(prog).parse_args(arguments)
    try:
        status: int = options.run(options)
    except KioskError as error:
        print(f"the operator's log can't be read: {error}", file=sys.stderr)
        return 2
    return status


def _verify(options: Namespace) -> int:
    folder = data_folder(options)
    comparison = Comparison(read_copy(options.against)) if options.against else None
    against = comparison.fault if comparison else None
    keys = options.key or _own_key(folder)
    with terminal_progress("entries verified") as progress:
        verification = verify(folder, options.head, keys, against, progress)
    fault = verification.fault or (comparison.end_fault() if comparison else "")
    if fault:
        print(f"the log was changed: {fault} ({verification.count} entries verified)")
        return 1
    print(f"ok, {verification.count} entries, head {verification.head}")
    for line in _proof(verification.signed, is_pinned=bool(options.key)):
        print(line)
    if comparison:
        print(f"the log has each of the {comparison.count} entries of the copy")
    return 0


def _own_key(folder: Path) -> tuple[str, ...]:
    """The key in the data folder; a copy of the folder may have none."""
    from app.records.log_key import load_key

    try:
        key = load_key(folder)
    except LogError as error:
        print(f"note: {error}", file=sys.stderr)
        return ()
    return (key.public,) if key else ()


def _proof(signed: Signed, is_pinned: bool) -> Iterator[str]:
    """What is proven by signatures."""
    if not signed.key:
        yield "no entry is signed: the chain alone shows no change by a program that computes hashes"
        return
    at = datetime.fromtimestamp(signed.at / 1000).astimezone().isoformat(timespec="seconds")
    yield f"signed up to entry {signed.seq} at {at} with the key {signed.key}"
    if not is_pinned:
        yield "compare this key with the one that you noted, or name that with --key"
    if signed.unsigned:
        yield f"the {signed.unsigned} entries after it are proven by the chain only"


def _key(options: Namespace) -> int:
    from app.records.log_key import load_key

    folder = data_folder(options)
    key = load_key(folder)
    if key is None:
        print(f"there is no key in {folder}: the server makes it at its first start", file=sys.stderr)
        return 1
    print(key.public)
    return 0


def public_key(text: str) -> str:
    """The type of an argument."""
    from app.records.log_key import parse_public_key

    try:
        return parse_public_key(text)
    except ValueError as error:
        raise ArgumentTypeError(str(error)) from None


def _panel(options: Namespace) -> int:
    """Prints the panel file that was shown at a time, or writes it and all of its files."""
    from app.records.shown_panel import read_panel, runs, shown_at

    folder = data_folder(options)
    starts = runs(folder)
    now = time.time_ns() // 1_000_000
    try:
        shown = shown_at(starts, now if options.at is None else options.at, now)
        began = datetime.fromtimestamp(shown.run.at / 1000).astimezone().isoformat(timespec="seconds")
        print(f"entry {shown.run.seq}: the server started at {began}", file=sys.stderr)
        for doubt in shown.doubts:
            print(f"note: {doubt}", file=sys.stderr)
        if options.to is not None:
            return _write_files(folder, shown.run, options.to)
        sys.stdout.buffer.write(read_panel(folder, shown.run))
    except LogError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


def _write_files(folder: Path, run: "Run", to: Path) -> int:
    from app.records.shown_panel import read_files

    missing = 0
    try:
        for name, data in read_files(folder, run):
            if isinstance(data, LogError):
                print(data, file=sys.stderr)
                missing += 1
                continue
            path = to / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data)
    except OSError as error:
        print(f"{error.filename} can't be written: {error.strerror}", file=sys.stderr)
        return 1
    print(f"written to {to}", file=sys.stderr)
    return 1 if missing else 0


def _export(options: Namespace) -> int:
    """Writes the whole log as CSV: beside the file first, so that there is never a part of it."""
    from app.records.reader import export, gzipped
    from app.system.csv_text import ROWS_AT_ONCE

    folder, file = data_folder(options), options.file
    db = open_read_only(folder)
    try:
        with as_log_error():
            total = entry_count(db)
    finally:
        db.close()
    with terminal_progress("entries exported") as progress:

        def counted() -> Iterator[bytes]:
            pieces = export(folder, Filter(every=True), None, language=options.language)
            for number, piece in enumerate(pieces, 1):
                yield piece
                progress(min(number * ROWS_AT_ONCE, total), total)

        try:
            with whole_file(file) as target:
                target.writelines(gzipped(counted()) if file.suffix == ".gz" else counted())
        except OSError as error:
            print(f"{file} can't be written: {error.strerror}", file=sys.stderr)
            return 1
    print(f"{total} entries written to {file}", file=sys.stderr)
    return 0


def _time(text: str) -> int:
    """Milliseconds since 1970."""
    return int(point_in_time(text).timestamp() * 1000)


def make_parser(prog: str) -> Parser:
    parser = Parser(prog=prog, description="The operator's log.")
    commands = parser.add_subparsers(metavar="COMMAND", required=True)
    check = commands.add_parser("verify", help="check that no entry was changed")
    check.set_defaults(run=_verify)
    add_data_folder(check)
    check.add_argument(
        "--head",
        default="",
        metavar="HASH",
        help="a hash saved earlier; the check fails if the log no longer contains it",
    )
    check.add_argument(
        "--key",
        action="append",
        type=public_key,
        metavar="KEY",
        help="the public key that may sign, as `log key` printed it; may be given several times;"
        " default: the key in the data folder",
    )
    check.add_argument(
        "--against",
        type=Path,
        metavar="COPY",
        help="a copy of the log: the file of KIOSK_LOG_COPY, or what a syslog server has written",
    )
    key = commands.add_parser("key", help="print the public key that signs the log")
    key.set_defaults(run=_key)
    add_data_folder(key)
    csv = commands.add_parser("export", help="write the whole log to a file, as CSV")
    csv.set_defaults(run=_export)
    add_data_folder(csv)
    csv.add_argument(
        "file", type=Path, metavar="FILE", help="such as log.csv; log.csv.gz is compressed"
    )
    csv.add_argument("--language", choices=files(), default=ENGLISH, help="of the reasons; default: en")
    panel = commands.add_parser("panel", help="print the panel file that was shown at a time")
    panel.set_defaults(run=_panel)
    add_data_folder(panel)
    panel.add_argument(
        "--at",
        type=_time,
        metavar="TIME",
        help="like 2027-01-20T10:00, in this machine's zone if it has none; default: now",
    )
    panel.add_argument(
        "--to",
        type=Path,
        metavar="FOLDER",
        help="write the panel file and all files that it used into this folder",
    )
    return parser

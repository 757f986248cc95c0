"""Which panel was shown at a time, by the operator's log and the files that are kept beside it."""

import json
import sqlite3
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Final

from app.records.database import as_log_error, open_read_only
from app.records.starts import FILE_GROUPS, PANEL, KeptFiles, Manifest, parse_manifest
from app.system.clock import iso_time
from app.system.errors import LogError

CLOCK_SET_BY_MS: Final = 60_000  # a larger change of the wall clock is no drift


@dataclass(frozen=True, slots=True)
class Run:
    """The time from a start of the server to its last entry, in ms; `seq` is the entry of the start.
    `set_by` is by how much the clock was set in between, 0 if it was not. `files` is the hash of its
    manifest, "" if an earlier version wrote the entry."""

    seq: int
    at: int
    last: int
    set_by: int
    files: str


@dataclass(frozen=True, slots=True)
class PanelStart:
    """The start whose panel was shown, and what makes that uncertain."""

    run: Run
    doubts: tuple[str, ...]


def runs(folder: Path) -> list[Run]:
    """All starts of which the log has the entry, the oldest first; LogError."""
    db = open_read_only(folder)
    try:
        with as_log_error():
            return list(_runs(db))
    finally:
        db.close()


def _runs(db: sqlite3.Connection) -> Iterator[Run]:
    boots = db.execute(
        "SELECT boot, max(at), max(at - monotonic / 1000) - min(at - monotonic / 1000)"
        " FROM entry GROUP BY boot"
    )
    ends = {boot: (last, moved) for boot, last, moved in boots}
    begun = """SELECT seq, at, boot, "values" FROM entry WHERE kind = 'began' ORDER BY seq"""
    for seq, at, boot, values in db.execute(begun):
        about = _parsed(values)
        if "mode" not in about:
            continue  # it says why a file is new
        last, moved = ends[boot]
        yield Run(seq, at, last, moved if moved > CLOCK_SET_BY_MS else 0, str(about.get("files", "")))


def _parsed(values: str) -> Mapping[str, object]:
    try:
        about = json.loads(values)
    except ValueError:
        return {}
    return about if isinstance(about, dict) else {}


def shown_at(starts: Sequence[Run], at: int, now: int) -> PanelStart:
    """The start whose panel was shown at a time (ms); LogError if the log does not know."""
    if not starts:
        raise LogError("the log has no entry of a start of the server")
    following = [*starts[1:], None]
    fitting = [
        run
        for run, later in zip(starts, following, strict=True)
        if run.at <= at and (later is None or at < later.at or later.at < run.at)
    ]
    fitting = [run for run in fitting if run is starts[-1] or at <= run.last] or fitting[-1:]
    if not fitting:
        first = _time(min(run.at for run in starts))
        raise LogError(f"the log begins later: the first start that it knows was at {first}")
    run = fitting[-1]
    return PanelStart(run, tuple(_doubts(run, fitting, starts, at, now)))


def _doubts(
    run: Run, fitting: Sequence[Run], starts: Sequence[Run], at: int, now: int
) -> Iterator[str]:
    if at > now:
        yield "that time is in the future: this is the panel of the last start"
    elif at > run.last:
        yield (
            f"the last entry of that server was at {_time(run.last)}: it may have ended before the time"
            " that you asked for"
        )
    if len(fitting) > 1:
        entries = ", ".join(str(each.seq) for each in fitting)
        yield f"the clock was set back: the starts in entries {entries} fit; this is the last of them"
    if run.set_by:
        yield f"the clock was set by {run.set_by // 1000} s while that server ran"
    if any(later.at < earlier.at for earlier, later in pairwise(starts)) and len(fitting) == 1:
        yield "the clock was set back between two starts: times before and after that overlap"


def read_manifest(folder: Path, run: Run) -> Manifest:
    """The files of a start; LogError if they are not known, or no longer kept."""
    if not run.files:
        raise LogError(
            f"entry {run.seq} names no files: the version that wrote it kept none, or could not"
        )
    try:
        return parse_manifest(_read(folder, run.files, f"the list of files of entry {run.seq}"))
    except ValueError as error:
        raise LogError(f"the list of files of entry {run.seq} can't be read: {error}") from error


def read_panel(folder: Path, run: Run) -> bytes:
    """The panel file of a start; LogError."""
    name, digest = next(iter(read_manifest(folder, run).files.get(PANEL, {}).items()), ("", ""))
    return _read(folder, digest, f"the panel file {name} of entry {run.seq}")


def read_files(folder: Path, run: Run) -> Iterator[tuple[str, bytes | LogError]]:
    """Path below a folder, and content, of every file of a start that is kept, or why it is not."""
    manifest = read_manifest(folder, run)
    yield "manifest.json", manifest.as_json()
    for group in (*FILE_GROUPS, "program"):
        for name, digest in manifest.files.get(group, {}).items():
            path = Path(Path(name).name) if group == PANEL else Path(group, *_below(name))
            try:
                yield str(path), _read(folder, digest, f"{group}: {name}")
            except LogError as error:
                yield str(path), error


def _below(name: str) -> list[str]:
    """The parts of a name, without those that lead out of a folder."""
    return [part for part in Path(name).parts if part not in ("/", "..")]


def _read(folder: Path, digest: str, subject: str) -> bytes:
    try:
        return KeptFiles(folder).read(digest)
    except OSError as error:
        raise LogError(f"{subject} can't be read: {error.strerror}") from error
    except LogError as error:
        raise type(error)(f"{subject} is not kept (SHA-256 {digest}): {error}") from error


def _time(ms: int) -> str:
    return iso_time(ms / 1000)

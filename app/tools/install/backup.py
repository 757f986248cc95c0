"""A backup of a panel in one zip, made while its server runs, and what puts it back.

Databases are copied by SQLite's backup API, never as files. A backup has the key of the log and the
hashes of the users' secrets: it is for its owner only, and not encrypted.
"""

import ctypes
import errno
import hashlib
import json
import os
import re
import shutil
import sqlite3
import tempfile
import time
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import IO, Any, Final

from app.cell.recipes.book import FOLDER as RECIPES
from app.cell.stops.shown import FOLDER as VIEWS
from app.records.data_dir import LOCK, DataDir
from app.records.database import NAME as LOG
from app.records.database import VERSION as LOG_VERSION
from app.records.log_key import load_key
from app.records.starts import FOLDER as KEPT
from app.records.starts import RESTORED
from app.records.verify import verify
from app.system.clock import iso_time
from app.system.errors import KioskError, LogError
from app.system.version import installed_version
from app.system.whole_file import sync_folder
from app.tools.install.panel_files import copies_for, users_file

FORMAT: Final = 1  # of the zip
MANIFEST: Final = "manifest.json"
DATA: Final = "data/"
PANEL: Final = "panel/"
RECORDINGS: Final = "recordings"
FOLDERS: Final = (KEPT, RECIPES, VIEWS)  # of the data folder; others are those of other panels
# What a database is while it is used, and what a killed process left behind.
LEFT_OUT: Final = re.compile(r".*\.sqlite3-(wal|shm|journal)|.*\.(new|unfinished)|" + re.escape(LOCK))
SET_ASIDE: Final = re.compile(r".*\.(damaged|found)-.*")  # no server writes these any more
DATABASE: Final = re.compile(r"[\w-]+\.sqlite3")
SAFE_NAME: Final = re.compile(r"(?:data|panel)(?:/[^/\0]+)+")
PIECE: Final = 1 << 20
MOST_MANIFEST: Final = 64_000_000
RENAME_EXCHANGE: Final = 2
AT_FDCWD: Final = -100


class BackupError(KioskError):
    """A backup that can't be made, or is not one that can be restored."""


@dataclass(frozen=True, slots=True)
class Made:
    """What a backup has: files, bytes before they are packed, and the log's entries."""

    files: int
    size: int
    entries: int


@dataclass(frozen=True, slots=True)
class Restored:
    """`aside` has the old data, None if there was none."""

    made: Made
    aside: Path | None


@dataclass(frozen=True, slots=True)
class Check:
    """How the log is verified: as `log verify` does, by `keys`, else by the key of the data folder.
    Without `required` a fault of its chain is passed over."""

    keys: tuple[str, ...] = ()
    required: bool = True


def make_backup(
    data: Path, panel: Path | None, target: Path, *, recordings: bool, check: Check
) -> Made:
    """Writes the zip to `target`, an empty file, after its parts are checked. BackupError, OSError,
    SettingsError for what the panel file names and can't be copied."""
    if not data.is_dir():
        raise BackupError(f"there is no data folder {data}: no server has run with these settings")
    target.chmod(0o600)
    with tempfile.TemporaryDirectory(prefix=".operator-panel-backup-", dir=target.parent) as name:
        stage = Path(name)
        _copy_data(data, stage / DATA, recordings)
        if panel is not None:
            _copy_panel(panel, stage / PANEL)
        entries, head = check_data(stage / DATA, check)
        files = {file: _about(stage / file) for file in _below(stage)}
        manifest = {
            "format": FORMAT,
            "version": installed_version(),
            "made": iso_time(time.time()),
            "panel": f"{PANEL}{panel.name}" if panel else "",
            "log": {"entries": entries, "head": head},
            "files": files,
        }
        with zipfile.ZipFile(
            target, "w", zipfile.ZIP_DEFLATED, compresslevel=1, strict_timestamps=False
        ) as packed:
            packed.writestr(MANIFEST, json.dumps(manifest, indent=1, ensure_ascii=False))
            for file in files:
                packed.write(stage / file, file)
        with target.open("rb") as written:
            os.fsync(written.fileno())
    with _opened(target) as packed:
        for file, about in _manifest(packed)["files"].items():
            _read(packed, file, about, None)
    return Made(len(files), sum(about["size"] for about in files.values()), entries)


def _copy_data(data: Path, into: Path, recordings: bool) -> None:
    into.mkdir(mode=0o700)
    for source in sorted(data.iterdir()):
        if source.is_symlink() or (
            LEFT_OUT.fullmatch(source.name) and not SET_ASIDE.match(source.name)
        ):
            continue
        if source.is_dir():
            if source.name in FOLDERS or (recordings and source.name == RECORDINGS):
                for name in _below(source):
                    if not LEFT_OUT.fullmatch(PurePosixPath(name).name):
                        _copy(source / name, into / source.name / name)
        elif DATABASE.fullmatch(source.name):
            copy_database(source, into / source.name)
        elif source.is_file():
            _copy(source, into / source.name)


def copy_database(source: Path, target: Path) -> None:
    """A copy of a database at one moment, also while another process writes it; BackupError."""
    try:
        with (
            closing(sqlite3.connect(f"{source.absolute().as_uri()}?mode=ro", uri=True)) as old,
            closing(sqlite3.connect(target)) as new,
        ):
            old.backup(new)
            new.execute("PRAGMA journal_mode = DELETE")  # one file; the server sets WAL again
        shutil.copystat(source, target)
    except sqlite3.Error as error:
        raise BackupError(f"{source} can't be copied: {error}") from error


def _copy(source: Path, target: Path) -> None:
    """A file that was removed since it was listed is left out: old ones make room."""
    target.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    with suppress(FileNotFoundError):
        shutil.copy2(source, target)


def _copy_panel(panel: Path, into: Path) -> None:
    contents = {panel.name: users_file(panel)}
    for copied in copies_for(panel, ""):
        contents |= {file: copied.source.read(file) for file in copied.files}
    for name, content in contents.items():
        target = into / name
        target.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        target.write_bytes(content)


def _below(folder: Path) -> list[str]:
    """The files below a folder, by their paths in it."""
    files = (path for path in folder.rglob("*") if path.is_file() and not path.is_symlink())
    return sorted(path.relative_to(folder).as_posix() for path in files)


def _about(path: Path) -> dict[str, Any]:
    with path.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    about = path.stat()
    return {"sha256": digest, "size": about.st_size, "modified": about.st_mtime}


def check_data(folder: Path, check: Check) -> tuple[int, str]:
    """Checks a copied data folder: its databases, and the chain and signatures of its log. The log's
    entries and head; BackupError."""
    for path in sorted(folder.glob("*.sqlite3")):
        if DATABASE.fullmatch(path.name):
            _check_database(path)
    if not (folder / LOG).exists():
        return 0, ""
    try:
        key = None if check.keys else load_key(folder)
        verified = verify(folder, keys=check.keys or ((key.public,) if key else ()))
    except LogError as error:
        raise BackupError(f"the operator's log can't be read: {error}") from error
    if verified.fault and check.required:
        raise BackupError(f"the operator's log was changed: {verified.fault}")
    for suffix in ("-wal", "-shm"):
        (folder / (LOG + suffix)).unlink(missing_ok=True)
    return verified.count, verified.head


def _check_database(path: Path) -> None:
    try:
        with closing(sqlite3.connect(path)) as db:
            ((fault, *_), *_) = db.execute("PRAGMA integrity_check(1)").fetchall()
            (version,) = db.execute("PRAGMA user_version").fetchone()
    except sqlite3.Error as error:
        fault, version = str(error), 0
    if fault != "ok":
        raise BackupError(f"{path.name} is damaged: {fault}")
    if path.name == LOG and version > LOG_VERSION:
        raise BackupError(f"the log has the version {version}; this program reads up to {LOG_VERSION}")


# To restore: the whole zip is checked in a folder beside the data folder, which then takes its place.


@contextmanager
def _opened(file: Path) -> Iterator[zipfile.ZipFile]:
    try:
        with zipfile.ZipFile(file) as packed:
            yield packed
    except (zipfile.BadZipFile, zipfile.LargeZipFile, EOFError, NotImplementedError) as error:
        raise BackupError(f"{file} is damaged, or not a backup: {error}") from error


def _manifest(packed: zipfile.ZipFile) -> dict[str, Any]:
    try:
        if packed.getinfo(MANIFEST).file_size > MOST_MANIFEST:
            raise BackupError(f"{MANIFEST} of the backup is too large")
        manifest: dict[str, Any] = json.loads(packed.read(MANIFEST))
        layout, version = manifest["format"], manifest["version"]
        files = {
            str(name): (about["sha256"], about["size"]) for name, about in manifest["files"].items()
        }
    except (KeyError, ValueError, TypeError, AttributeError) as error:
        raise BackupError(f"that is not a backup: its {MANIFEST} can't be read ({error})") from error
    if layout != FORMAT:
        raise BackupError(f"the backup has the format {layout}; this program reads {FORMAT}")
    if _numbers(version) > _numbers(installed_version()):
        raise BackupError(
            f"the backup was made by version {version}, this is {installed_version()}: update first"
        )
    for name in files:
        if not SAFE_NAME.fullmatch(name) or ".." in name.split("/"):
            raise BackupError(f'the backup has a file with the name "{name}"')
    names = set(packed.namelist()) - {MANIFEST}
    for name in sorted(names ^ files.keys()):
        where = (
            f"is missing in the backup: {MANIFEST} names it" if name in files else "is not in its list"
        )
        raise BackupError(f"{name} {where}")
    return manifest


def _numbers(version: str) -> tuple[int, ...]:
    """() for a checkout, which is older than none."""
    match = re.match(r"\d+(?:\.\d+)*", version)
    return tuple(map(int, match.group().split("."))) if match else ()


def _read(packed: zipfile.ZipFile, name: str, about: Mapping[str, Any], into: IO[bytes] | None) -> None:
    """Reads a file of a backup, and writes it `into`; BackupError if it is not as its list says."""
    digest, size = hashlib.sha256(), 0
    try:
        with packed.open(name) as source:
            while piece := source.read(PIECE):
                digest.update(piece)
                size += len(piece)
                if into is not None:
                    into.write(piece)
    except (zipfile.BadZipFile, zlib.error) as error:
        raise BackupError(f"{name} of the backup is damaged: {error}") from error
    if (digest.hexdigest(), size) != (about["sha256"], about["size"]):
        raise BackupError(f"{name} of the backup is damaged: it does not have its SHA-256")


def _unpack(packed: zipfile.ZipFile, files: Mapping[str, Any], prefix: str, into: Path) -> None:
    """Writes the files below `prefix`, readable by their owner only, and syncs them."""
    for name, about in files.items():
        if not name.startswith(prefix):
            _read(packed, name, about, None)
            continue
        path = into / name.removeprefix(prefix)
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        with open(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as target:
            _read(packed, name, about, target)
            target.flush()
            os.fsync(target.fileno())
        with suppress(KeyError, TypeError, ValueError, OverflowError):
            os.utime(path, (float(about["modified"]),) * 2)


def restore(file: Path, data: Path, check: Check) -> Restored:
    """Puts the data of a backup in the place of the folder `data`, whose old content is kept beside it.
    Until then nothing of it is changed. FolderInUse while a server has it, BackupError, OSError."""
    data = data.resolve()  # the folder of a unit is a link
    stamp = time.strftime("%Y%m%dT%H%M%SZ", time.gmtime())
    stage = data.with_name(f"{data.name}.restoring-{stamp}")
    with _opened(file) as packed, ExitStack() as claims:
        manifest = _manifest(packed)
        files = manifest["files"]
        size = sum(int(about["size"]) for about in files.values())
        is_new = not data.exists()
        for folder in (data, *(lock.parent for lock in sorted(data.glob(f"*/{LOCK}")))):
            claimed = DataDir(folder)  # those of other panels move along
            claimed.claim()
            claims.callback(claimed.release)
        try:
            if shutil.disk_usage(data.parent).free < size:
                raise BackupError(f"the disk of {data} is too full: {size / 1e6:.0f} MB are needed")
            with _removed_on_failure(stage):
                _unpack(packed, files, DATA, stage)
                entries, head = check_data(stage, check)
                _mark(stage, file, manifest, entries, head)
                _own(stage, data.stat())
                _exchange(stage, data)
        except BaseException:
            if is_new:
                shutil.rmtree(data, ignore_errors=True)
            raise
        aside = _set_aside(stage, data, stamp)
    if is_new:
        shutil.rmtree(aside)
    return Restored(Made(len(files), size, entries), None if is_new else aside)


@contextmanager
def _removed_on_failure(stage: Path) -> Iterator[None]:
    """Makes a folder, and removes it if the block fails: never what was exchanged with it."""
    stage.mkdir(mode=0o700)
    made = stage.stat()
    try:
        yield
    except BaseException:
        with suppress(FileNotFoundError):
            if os.path.samestat(made, stage.stat()):
                shutil.rmtree(stage, ignore_errors=True)
        raise


def write_panel(file: Path, folder: Path) -> Path:
    """Writes the panel file of a backup and what it names into a new folder; its path. BackupError if
    the backup has none, OSError."""
    with _opened(file) as packed:
        manifest = _manifest(packed)
        if not manifest["panel"]:
            raise BackupError(f"{file} has no panel file")
        with _removed_on_failure(folder):
            _unpack(packed, manifest["files"], PANEL, folder)
    return folder / str(manifest["panel"]).removeprefix(PANEL)


def _mark(stage: Path, file: Path, manifest: Mapping[str, Any], entries: int, head: str) -> None:
    """For the entry of the next start."""
    with file.open("rb") as source:
        digest = hashlib.file_digest(source, "sha256").hexdigest()
    about = {
        "at": iso_time(time.time()), "made": manifest["made"], "sha256": digest, "entries": entries,
        "head": head,
    }  # fmt: skip
    (stage / RESTORED).write_text(json.dumps(about))
    (stage / RESTORED).chmod(0o600)


def _own(stage: Path, owner: os.stat_result) -> None:
    """The restored folder is that of the user of the old one."""
    for path in (stage, *stage.rglob("*")):
        if (owner.st_uid, owner.st_gid) != (os.geteuid(), os.getegid()):
            os.chown(path, owner.st_uid, owner.st_gid, follow_symlinks=False)


def _exchange(stage: Path, data: Path) -> None:
    """Exchanges the two folders in one step: at each moment there is the old one or the new one."""
    sync_folder(stage)
    exchange_folders(stage, data)
    sync_folder(data.parent)


def _set_aside(old: Path, data: Path, stamp: str) -> Path:
    """Names the old data; recordings that are not in the backup, and the folders of other panels, move
    to the new."""
    aside = data.with_name(f"{data.name}.before-{stamp}")
    try:
        old.rename(aside)
    except OSError:
        aside = old
    names = {path.name for path in data.iterdir()}
    for path in sorted(aside.iterdir()):
        if path.is_dir() and path.name not in {*names, *FOLDERS}:
            path.rename(data / path.name)
    return aside


def exchange_folders(left: Path, right: Path) -> None:
    """renameat2(RENAME_EXCHANGE); BackupError where the file system has none."""
    libc = ctypes.CDLL(None, use_errno=True)
    flags = (AT_FDCWD, os.fsencode(left), AT_FDCWD, os.fsencode(right), RENAME_EXCHANGE)
    if libc.renameat2(*flags):
        code = ctypes.get_errno()
        why = os.strerror(code)
        if code in (errno.EINVAL, errno.ENOSYS, errno.EXDEV, errno.EBUSY):
            why = f"{why}. The data folder has to be on a local disk, and not be a mount itself"
        raise BackupError(f"{right} can't be exchanged: {why}. Nothing was changed")

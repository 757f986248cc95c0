"""Starts of the server in the operator's log: the files and settings of each start, and what has
changed."""

import hashlib
import json
import logging
import os
import re
import tomllib
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from app.records.entry import LONGEST_VALUES, Entry, new_entry
from app.system.errors import LogError
from app.system.settings import PACKAGE, PREFIX, Settings, shipped_path
from app.system.texts import say
from app.system.texts.catalogue import files as catalogues
from app.system.toml_values import key_text, value_text
from app.system.version import installed_version
from app.system.whole_file import SUFFIX, write_whole

if TYPE_CHECKING:
    from app.panel import Panel


# Files by their SHA-256, kept beside the operator's log: each content once, bounded in number and
# bytes. Blocks.

FOLDER: Final = "kept-files"
RESTORED: Final = "restored.json"  # of the data folder: by which backup it was restored, and when
MOST_FILES: Final = 5000
MOST_BYTES: Final = 256_000_000
HASH: Final = re.compile(r"[0-9a-f]{64}")


class FileNotKept(LogError):
    """There is no file with this hash: it was never kept, or was removed since."""


class FileChanged(LogError):
    """The content of a kept file does not have its hash."""


def sha256(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()


class KeptFiles:
    """The folder of kept files; the newest use of each is its time of modification."""

    def __init__(self, data: Path, most_files: int = MOST_FILES, most_bytes: int = MOST_BYTES) -> None:
        self.folder = data / FOLDER
        self._most_files = most_files
        self._most_bytes = most_bytes

    def keep(self, contents: Mapping[str, bytes]) -> list[str]:
        """Keeps each content by its hash, in this order as long as all of them fit; returns the hashes
        of those that do not. Files that were not used for the longest time make room. OSError."""
        self.folder.mkdir(mode=0o700, exist_ok=True)
        self.folder.chmod(0o700)
        kept: list[str] = []
        too_many: list[str] = []
        room = self._most_bytes
        for digest, data in contents.items():
            if len(data) > room or len(kept) == self._most_files:
                too_many.append(digest)
                continue
            room -= len(data)
            kept.append(digest)
        self._prune(kept, sum(len(contents[digest]) for digest in kept))
        for digest in kept:
            self._write(digest, contents[digest])
        return too_many

    def read(self, digest: str) -> bytes:
        """The content with this hash; FileNotKept, FileChanged, OSError."""
        path = self.folder / digest
        if not HASH.fullmatch(digest):
            raise FileNotKept(f'"{digest}" is not the SHA-256 of a file')
        try:
            data = path.read_bytes()
        except FileNotFoundError:
            raise FileNotKept(f"{path} is not there") from None
        if sha256(data) != digest:
            raise FileChanged(f"{path} was changed: its SHA-256 is no longer its name")
        return data

    def _write(self, digest: str, data: bytes) -> None:
        path = self.folder / digest
        with suppress(OSError):
            if path.stat().st_size == len(data):
                os.utime(path)
                return
        write_whole(path, data)

    def _prune(self, needed: Collection[str], needed_bytes: int) -> None:
        """Removes files until those that are needed fit, the longest unused first."""
        others = sorted(self._files(without=frozenset(needed)))
        used = needed_bytes + sum(size for _, size, _ in others)
        count = len(needed) + len(others)
        for _, size, path in others:
            if count <= self._most_files and used <= self._most_bytes:
                return
            path.unlink(missing_ok=True)
            used, count = used - size, count - 1

    def _files(self, without: Collection[str]) -> Iterator[tuple[float, int, Path]]:
        """Time, size and path of each file; what a server that was killed left behind is removed."""
        for path in self.folder.iterdir():
            if path.name.endswith(SUFFIX):
                path.unlink(missing_ok=True)
            elif path.name not in without and path.is_file():
                about = path.stat()
                yield about.st_mtime, about.st_size, path


def list_text(files: Iterable[tuple[str, str]]) -> bytes:
    """What `sha256sum` prints for files, by the order of their names: (name, hash) of each."""
    return "".join(f"{digest}  {name}\n" for name, digest in sorted(files)).encode()


def list_digest(files: Iterable[tuple[str, str]]) -> str:
    """One hash for files: that of their list. "" without files."""
    text = list_text(files)
    return sha256(text) if text else ""


# The files and settings that a server starts with, by their hashes: its manifest.

DEFINITIONS: Final = re.compile(r".*\.(msg|srv|action)")
MOST_DEFINITIONS: Final = 2000
PROGRAM: Final = (".py", ".po", ".json", ".toml", ".html", ".js", ".css", ".svg")
SECRET: Final = re.compile(r"(?i)password|passwd|secret|token|\bpin\b|_pin\b|private|credential")
USER_IN_URL: Final = re.compile(r"(?<=//)[^/@\s]+@")
HIDDEN: Final = "…"

# The groups of files, in the order in which they are kept. The Zenoh file may have a password and the
# program is in its wheel: of the one only the hash is, of the other the list of hashes. Fonts are
# large, and say nothing of what the panel does: only their hashes are kept.
PANEL: Final = "panel"
FILE_GROUPS: Final = (PANEL, "templates", "styles", "definitions", "catalogues", "pictures", "maps")
GROUPS: Final = (*FILE_GROUPS, "fonts", "zenoh", "program")


@dataclass(frozen=True, slots=True)
class Manifest:
    """The version, the settings as text, group → name of a file → SHA-256, and `user <name>` or
    `token <name>` → role and groups; None for a start of a version that did not keep them."""

    version: str
    settings: Mapping[str, str]
    files: Mapping[str, Mapping[str, str]]
    users: Mapping[str, str] | None = None

    def as_json(self) -> bytes:
        about: dict[str, Any] = {
            "version": self.version,
            "settings": self.settings,
            "files": self.files,
        }
        if self.users is not None:
            about["users"] = self.users
        return json.dumps(about, ensure_ascii=False, sort_keys=True, indent=1).encode()

    def digests(self) -> dict[str, str]:
        """One hash for the settings, for the users with their roles, and for each group with files:
        that of the file itself for the panel file and the Zenoh file, else that of their list; of the
        program, that list is a file."""
        own: dict[str, str] = {}
        for group, files in self.files.items():
            alone = group in (PANEL, "zenoh", "program") and len(files) == 1
            own[group] = next(iter(files.values())) if alone else list_digest(files.items())
        if self.users:
            own["users"] = _text_digest(self.users)
        own["settings"] = _text_digest(self.settings)
        return {name: digest for name, digest in own.items() if digest}


def _text_digest(values: Mapping[str, str]) -> str:
    text = "".join(f"{name}={value}\n" for name, value in sorted(values.items()))
    return sha256(text.encode())


def parse_manifest(data: bytes) -> Manifest:
    """ValueError if that is not a manifest."""
    about = json.loads(data)
    try:
        users = dict(about["users"]) if "users" in about else None
        return Manifest(str(about["version"]), dict(about["settings"]), dict(about["files"]), users)
    except (KeyError, TypeError) as error:
        raise ValueError(f"not a list of files: {error}") from error


@dataclass(frozen=True, slots=True)
class StartFiles:
    """A manifest, with the contents of the files that are kept: SHA-256 → bytes."""

    manifest: Manifest
    contents: Mapping[str, bytes]


def read_start_files(
    settings: Settings, panel: "Panel", mode: str, users: Callable[[], Mapping[str, str]] = dict
) -> StartFiles:
    """Reads all files. One that can't be read has the error in place of its hash. `users` returns the
    users of the manifest. Blocks."""
    contents: dict[str, bytes] = {}
    files: dict[str, dict[str, str]] = {}
    for group, name, path in _paths(settings, panel):
        try:
            data = path.read_bytes()
        except OSError as error:
            files.setdefault(group, {})[name] = f"unreadable: {error.strerror}"
            continue
        digest = sha256(data)
        files.setdefault(group, {})[name] = digest
        if group in FILE_GROUPS:
            contents[digest] = data
    program = list_text(program_files())
    files["program"] = {"sha256sum": sha256(program)}
    contents[sha256(program)] = program
    texts = settings_text(settings, mode)
    return StartFiles(Manifest(installed_version(), texts, files, users()), contents)


def settings_text(settings: Settings, mode: str) -> dict[str, str]:
    """The settings in force as text, by the names of their variables; secrets are hidden."""
    values = {field.name: getattr(settings, field.name) for field in fields(settings)} | {"mode": mode}
    names = ((f"{PREFIX}{name.upper()}", value) for name, value in values.items())
    return {name: without_secret(name, _as_text(value)) for name, value in names}


def _as_text(value: object) -> str:
    """A setting as its variable would have it."""
    match value:
        case None | False:
            return ""
        case True:
            return "1"
        case (str(host), int(port)):
            return f"{host}:{port}"
        case tuple():
            return ",".join(map(str, value))
    return str(value)


def without_secret(name: str, text: str) -> str:
    """The text as it may be logged: not a secret, and not what stands before @ in an address."""
    return HIDDEN if text and SECRET.search(name) else USER_IN_URL.sub(f"{HIDDEN}@", text)


def _paths(settings: Settings, panel: "Panel") -> Iterator[tuple[str, str, Path]]:
    """Group, name and path of each file. Those of the panel have the name that the panel file has for
    them."""
    beside = settings.panel.parent
    yield PANEL, settings.panel.name, settings.panel
    for group, own in (
        ("templates", panel.templates),
        ("styles", panel.styles),
        ("maps", panel.geojson_files),
    ):
        yield from ((group, _name(path, beside), path) for path in own)
    for folder in panel.interfaces:
        paths = sorted(path for path in Path(folder).rglob("*") if DEFINITIONS.fullmatch(path.name))
        for path in paths[:MOST_DEFINITIONS]:
            yield "definitions", _name(path, beside), path
    for tag, path in catalogues().items():
        yield "catalogues", f"{tag}.po", Path(path)
    yield from (("pictures", name, path) for name, path in panel.picture_files.items())
    yield from (("fonts", _name(path, beside), path) for path in panel.font_files)
    yield "zenoh", settings.zenoh.name, settings.zenoh


def program_files() -> Iterator[tuple[str, str]]:
    """Name and hash of each file of the program. Plain calls of the system: there are many files, and
    the server waits for them."""
    beside = (shipped_path("templates"), shipped_path("static"))  # in the package, unless a checkout
    for root in map(str, (PACKAGE, *(path for path in beside if not path.is_relative_to(PACKAGE)))):
        for folder, _, names in os.walk(root):
            for name in names:
                if name.endswith(PROGRAM):
                    path = f"{folder}/{name}"
                    with open(path, "rb", buffering=0) as file:
                        digest = sha256(file.readall())
                    yield f"{os.path.basename(root)}{path.removeprefix(root)}", digest


def _name(path: Path, beside: Path) -> str:
    try:
        return str(path.relative_to(beside))
    except ValueError:
        return str(path)


# What has changed from one start of the server to the next, by the names of keys. Pure.

LONGEST: Final = 80  # characters of a value
MOST_ENTRIES: Final = 10  # of one start; the rest is counted
ARROW: Final = "→"
ABSENT: Final = "–"
MORE: Final = "… more"
# The groups of files whose changes are named by file; the program's are many, and its list is one.
BY_FILE: Final = ("templates", "styles", "definitions", "catalogues", "pictures", "maps", "fonts")


def flat(tables: Mapping[str, Any]) -> dict[str, str]:
    """Dotted key → its value as TOML writes it. A table of a list is named by its id, else by its
    number from 1; `… order` is the order of those with an id."""
    return dict(_flat("", tables))


def _flat(place: str, value: Any) -> Iterator[tuple[str, str]]:
    if isinstance(value, Mapping):
        for key, inner in value.items():
            yield from _flat(f"{place}.{key_text(key)}" if place else key_text(key), inner)
    elif isinstance(value, list) and value and all(isinstance(item, Mapping) for item in value):
        names = [_name_in_list(item, number) for number, item in enumerate(value, 1)]
        for name, item in zip(names, value, strict=True):
            yield from _flat(f"{place}.{name}", item)
        yield f"{place} order", ", ".join(names)
    else:
        text = value_text(value) if isinstance(value, bool | int | float | str | list) else str(value)
        yield place, text


def _name_in_list(table: Mapping[str, Any], number: int) -> str:
    name = table.get("id")
    return key_text(name) if isinstance(name, str) and name else str(number)


def changed_keys(old: Mapping[str, str], new: Mapping[str, str]) -> dict[str, str]:
    """Key → `old → new`, in the order of the new file, then those that are gone; secrets are hidden. An
    order counts as changed only if what is in both stands otherwise."""
    names = [*new, *(name for name in old if name not in new)]
    return {
        name: f"{_value_text(name, old)} {ARROW} {_value_text(name, new)}"
        for name in names
        if old.get(name) != new.get(name) and not _same_order(name, old, new)
    }


def _same_order(name: str, old: Mapping[str, str], new: Mapping[str, str]) -> bool:
    if not name.endswith(" order"):
        return False
    before, after = (tables.get(name, "").split(", ") for tables in (old, new))
    common = set(before) & set(after)
    return [each for each in before if each in common] == [each for each in after if each in common]


def _value_text(name: str, tables: Mapping[str, str]) -> str:
    """A value, cut and without a secret."""
    text = tables.get(name)
    if text is None:
        return ABSENT
    return _cut(without_secret(name.rpartition(".")[2], text))


def _cut(text: str) -> str:
    return text if len(text) <= LONGEST else text[: LONGEST - 1] + "…"


def parse_panel(data: bytes) -> dict[str, str] | None:
    """The keys of a panel file; None if that is no TOML."""
    try:
        return flat(tomllib.loads(data.decode("utf-8-sig")))
    except (ValueError, RecursionError):
        return None


def changes(
    old: Manifest, new: Manifest, old_panel: bytes | None, new_panel: bytes | None
) -> dict[str, str]:
    """What → `old → new`: version, settings, users with their roles, keys of the panel file, other
    files. `old_panel` is None if it is not kept."""
    own = {"version": old.version} | dict(old.settings)
    result = changed_keys(own, {"version": new.version} | dict(new.settings))
    result |= _user_changes(old.users, new.users)
    before, after = (dict(manifest.files) for manifest in (old, new))
    if _hashes(before, PANEL) != _hashes(after, PANEL):
        result |= _panel_changes(old_panel, new_panel)
    for group in BY_FILE:
        files = changed_keys(_short_hashes(before, group), _short_hashes(after, group))
        result |= {f"{group}: {name}": text for name, text in files.items()}
    for group in ("zenoh", "program"):
        if before.get(group) != after.get(group):
            result[group] = f"{_hash(before, group)} {ARROW} {_hash(after, group)}"
    return result


def _user_changes(old: Mapping[str, str] | None, new: Mapping[str, str] | None) -> dict[str, str]:
    """Users and tokens that are new, gone, or have other rights. None: not known."""
    if old is None or new is None:
        return {}
    names = [*new, *(name for name in old if name not in new)]
    texts = {name: (old.get(name, ABSENT), new.get(name, ABSENT)) for name in names}
    return {
        name: f"{_cut(before)} {ARROW} {_cut(after)}"
        for name, (before, after) in texts.items()
        if before != after
    }


def _panel_changes(old_panel: bytes | None, new_panel: bytes | None) -> dict[str, str]:
    old = parse_panel(old_panel) if old_panel is not None else None
    new = parse_panel(new_panel) if new_panel is not None else None
    if old is None or new is None:
        return {"panel file": "changed; one of the two is not kept, so its keys are not known"}
    return changed_keys(old, new) or {"panel file": "changed, but no key: comments or its form"}


def _hashes(files: Mapping[str, Mapping[str, str]], group: str) -> list[str]:
    return sorted(files.get(group, {}).values())


def _short_hashes(files: Mapping[str, Mapping[str, str]], group: str) -> dict[str, str]:
    return {name: digest[:12] for name, digest in files.get(group, {}).items()}


def _hash(files: Mapping[str, Mapping[str, str]], group: str) -> str:
    """The hash of a group with one file."""
    return "".join(digest[:12] for digest in files.get(group, {}).values()) or ABSENT


def in_entries(changed: Mapping[str, str]) -> Sequence[dict[str, str]]:
    """The changes as the values of as few entries as hold them; the last one counts what is left."""
    batches: list[dict[str, str]] = [{}]
    for number, (name, text) in enumerate(changed.items()):
        batch = batches[-1]
        room = LONGEST_VALUES - len(MORE) - 20
        if batch and len(json.dumps(batch | {name: text}, ensure_ascii=False)) > room:
            if len(batches) == MOST_ENTRIES:
                batch[MORE] = str(len(changed) - number)
                break
            batch = {}
            batches.append(batch)
        batch[name] = text
    return [batch for batch in batches if batch]


# The entries about a start of the server: what it runs with, and what has changed since the last start.
# The files are kept beside the log.

log = logging.getLogger("kiosk.log")


@dataclass(frozen=True, slots=True)
class StartRecord:
    """`read` reads the files of this start. `revision` is the beginning of the hash of the panel file
    that was loaded. Used on the writer's thread."""

    archive: KeptFiles
    read: Callable[[], StartFiles]
    revision: str

    def make(self, last_files: str) -> tuple[dict[str, Any], Sequence[Entry]]:
        """Keeps the files; returns the values of the entry of the start, and the entries about what
        has changed. `last_files` is the hash of the manifest of the last start, "" if there is none."""
        start = self.read()
        manifest = start.manifest
        as_json = manifest.as_json()
        values: dict[str, Any] = {"version": manifest.version} | manifest.digests()
        values["files"] = sha256(as_json)
        if not values.get(PANEL, "").startswith(self.revision):
            values["panel_loaded"] = self.revision  # the file was changed in the meantime
        if restored := self._restored():
            values["restored"] = restored
        old, old_panel = self._last(last_files)
        try:
            not_kept = self.archive.keep({values["files"]: as_json} | dict(start.contents))
        except OSError as error:
            log.error("the files of this start are not kept beside the operator's log: %s", error)
            values["kept"] = False
        else:
            if not_kept:
                log.warning("%d files are too large to be kept beside the log", len(not_kept))
                values["kept"] = False
        if old is None:
            return values, ()
        new_panel = start.contents.get(values.get(PANEL, ""))
        changed = changes(old, manifest, old_panel, new_panel)
        values["changes"] = len(changed)
        reason = say("log_changed", count=len(changed))
        return values, [
            new_entry("changed", values=batch, reason=reason) for batch in in_entries(changed)
        ]

    def _restored(self) -> str:
        """When this data was restored, and by which backup; "" if it never was."""
        with suppress(OSError, ValueError, KeyError, TypeError):
            about = json.loads((self.archive.folder.parent / RESTORED).read_bytes())
            return f"{about['at']}, backup of {about['made']}, SHA-256 {about['sha256']}"
        return ""

    def _last(self, last_files: str) -> tuple[Manifest | None, bytes | None]:
        """The manifest and the panel file of the last start, as far as they are kept."""
        if not last_files:
            return None, None
        try:
            manifest = parse_manifest(self.archive.read(last_files))
        except (LogError, OSError, ValueError) as error:
            log.warning("what has changed since the last start is not known: %s", error)
            return None, None
        try:
            return manifest, self.archive.read(next(iter(manifest.files.get(PANEL, {}).values()), ""))
        except (LogError, OSError):
            return manifest, None

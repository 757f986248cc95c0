"""The files and settings that a server starts with, by their hashes: its manifest."""

import json
import os
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from app.audit.kept_files import list_digest, list_text, sha256
from app.i18n.catalogue import files as catalogues
from app.settings import PACKAGE, PREFIX, Settings, shipped_path
from app.version import installed_version

if TYPE_CHECKING:
    from app.panel import Panel

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
KEPT: Final = (PANEL, "templates", "styles", "definitions", "catalogues", "pictures")
GROUPS: Final = (*KEPT, "fonts", "zenoh", "program")


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
        if group in KEPT:
            contents[digest] = data
    program = list_text(_program())
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
    for group, own in (("templates", panel.templates), ("styles", panel.styles)):
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


def _program() -> Iterator[tuple[str, str]]:
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

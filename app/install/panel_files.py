"""What a panel file names beside itself: it goes with the panel to where that is installed.

Read with Python's own TOML: the command runs from the wheel's file, with nothing installed.
"""

import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from os.path import normpath
from pathlib import Path, PurePosixPath
from typing import Any, Final

from app.errors import SettingsError
from app.install.files import write
from app.install.host import Host
from app.interfaces.package_folders import package_files

OF_PAGES: Final = ("template", "styles")


@dataclass(frozen=True, slots=True, kw_only=True)
class UsersCopy:
    """Files of the user's in the folder `into`: copied where they differ, kept at the end. `files` are
    paths relative to `into`, with their sources."""

    into: str
    name: str
    files: Mapping[str, Path]

    def describe(self, host: Host) -> str:
        number = len(self.files)
        return f"copy {self.name} into {self.into} ({number} file{'s' if number > 1 else ''})"

    def is_done(self, host: Host) -> bool:
        return all(
            (there := self._target(host, path)).is_file() and there.read_bytes() == file.read_bytes()
            for path, file in self.files.items()
        )

    def do(self, host: Host) -> None:
        for path, file in self.files.items():
            write(host, f"{self.into}/{path}", file.read_bytes(), 0o644)

    def undo(self, host: Host) -> str:
        there = any(self._target(host, path).is_file() for path in self.files)
        return f"kept {self.into}/{self.name}" if there else ""

    def _target(self, host: Host, path: str) -> Path:
        return host.path(f"{self.into}/{path}")


def copies_for(panel: Path, into: str) -> Iterator[UsersCopy]:
    """What has to be copied into the folder `into`, where the panel file will be. What has an absolute
    path stays where it is. SettingsError for what is missing, or not below the panel file's folder. A
    panel file that is no TOML names nothing: its check says what is wrong."""
    try:
        tables = tomllib.loads(panel.read_text("utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeDecodeError):
        return
    folder = panel.parent
    for name, list_files in _named(tables):
        if PurePosixPath(name).is_absolute():
            continue
        if normpath(name).startswith(".."):
            raise SettingsError(
                f'{panel} names "{name}", which is not below its own folder: an installed panel has all'
                " it needs beside it. Move it there, or name it by its absolute path"
            )
        if not (folder / name).exists():
            raise SettingsError(f'{panel} names "{name}", and {folder / name} is not there')
        files = {normpath(file.relative_to(folder)): file for file in list_files(folder / name)}
        yield UsersCopy(into=into, name=normpath(name), files=files)


def _named(tables: Mapping[str, Any]) -> Iterator[tuple[str, Callable[[Path], Iterable[Path]]]]:
    """(path, what lists its files) of each folder and file that a panel file names."""
    for name in _texts(tables.get("interfaces")):
        yield name, package_files
    for name in _texts([tables.get("pictures")]):
        yield name, lambda folder: filter(Path.is_file, folder.iterdir())
    pages = tables.get("page")
    for page in pages if isinstance(pages, list) else ():
        if isinstance(page, dict):
            for name in _texts([page.get(key) for key in OF_PAGES]):
                yield name, lambda file: [file]


def _texts(given: Any) -> list[str]:
    return [one for one in given if isinstance(one, str) and one] if isinstance(given, list) else []

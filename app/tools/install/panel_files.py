"""What a panel file names beside itself: it goes with the panel to where that is installed.

Read with Python's own TOML: the command runs from the wheel's file, with nothing installed.
"""

import re
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any, Final

from app.ros.messages.packages import package_files
from app.system.errors import SettingsError
from app.system.pictures import picture_files
from app.tools.install.file_tree import FileTree, OutsideError
from app.tools.install.host import Host
from app.tools.install.steps import has_content

OF_PAGES: Final = ("template", "styles")
# What an installation has in the folder of the installed panel file.
RESERVED_NAME: Final = re.compile(r"\.?(panel\.toml|zenoh\.json5|kiosk\.toml|release-keys\.pub)(\..*)?")


@dataclass(frozen=True, slots=True, kw_only=True)
class UsersCopy:
    """Files of the user's in the folder `into`: copied where they differ, kept at the end. `files` are
    paths relative to `into`, and to the folder `source`."""

    into: str
    name: str
    source: FileTree
    files: tuple[str, ...]

    def describe(self, host: Host) -> str:
        number = len(self.files)
        return f"copy {self.name} into {self.into} ({number} file{'s' if number > 1 else ''})"

    def is_done(self, host: Host) -> bool:
        return all(
            has_content(host, f"{self.into}/{file}", self.source.read(file)) for file in self.files
        )

    def do(self, host: Host) -> None:
        for file in self.files:
            host.files.write(f"{self.into}/{file}", self.source.read(file))

    def undo(self, host: Host) -> str:
        there = any(host.files.is_file(f"{self.into}/{file}") for file in self.files)
        return f"kept {self.into}/{self.name}" if there else ""


def users_file(path: Path) -> bytes:
    """The content of a file that the user names; SettingsError if it can't be read, or is a link out of
    its folder: what is installed can be read by every user."""
    try:
        return FileTree(path.parent.resolve(), confined=True).read(path.name)
    except OutsideError as error:
        raise SettingsError(
            f"{path} is not installed: {error.strerror}. Name that file itself"
        ) from error
    except OSError as error:
        raise SettingsError(f"{path} can't be read: {error.strerror}") from error


def copies_for(panel: Path, into: str) -> Iterator[UsersCopy]:
    """What has to be copied into the folder `into`, where the panel file will be. What has an absolute
    path stays where it is. SettingsError for what is missing, or not below the panel file's folder. A
    panel file that is no TOML names nothing: its check says what is wrong."""
    try:
        tables = tomllib.loads(users_file(panel).decode())
    except (tomllib.TOMLDecodeError, UnicodeDecodeError):
        return
    folder = FileTree(panel.parent.resolve(), confined=True)
    for key, name, list_files in _named(tables):
        path = PurePosixPath(name)
        if path.is_absolute():
            continue
        if ".." in path.parts:
            raise SettingsError(
                f'{panel} names "{name}", which is not below its own folder: an installed panel has all'
                " it needs beside it. Move it there, or name it by its absolute path"
            )
        if key == "pictures" and not path.parts:
            raise SettingsError(
                f'{panel}: pictures = "{name}" is the folder of the panel file itself: move the'
                ' pictures into a folder of their own, such as pictures = "pictures"'
            )
        if not (folder.root / path).exists():
            raise SettingsError(f'{panel} names "{name}", and {panel.parent / name} is not there')
        files = [str(file.relative_to(folder.root)) for file in list_files(folder.root / path)]
        for file in files:
            _check(panel, folder, file)
        yield UsersCopy(into=into, name=str(path), source=folder, files=tuple(files))


def _check(panel: Path, folder: FileTree, file: str) -> None:
    """SettingsError for a file that can't go with the panel."""
    if RESERVED_NAME.fullmatch(file):
        raise SettingsError(
            f'{panel} names "{file}", which is the name of a file of the installation: give it another'
        )
    try:
        folder.read(file)
    except OutsideError as error:
        raise SettingsError(
            f'{panel} names "{file}", and {error.strerror}: an installed panel has only what is really'
            " below its own folder. Put the file itself there"
        ) from error
    except OSError as error:
        raise SettingsError(f"{folder.root / file} can't be read: {error.strerror}") from error


def _named(
    tables: Mapping[str, Any],
) -> Iterator[tuple[str, str, Callable[[Path], Iterable[Path]]]]:
    """(key, path, what lists its files) of each folder and file that a panel file names."""
    for name in _texts(tables.get("interfaces")):
        yield "interfaces", name, package_files
    for name in _texts([tables.get("pictures")]):
        yield "pictures", name, lambda folder: picture_files(folder).values()
    for font in _tables(tables.get("font")):
        for name in _texts([font.get("regular"), font.get("bold")]):
            yield "font", name, lambda file: [file]
    for table in _tables(tables.get("zone_file")):
        for name in _texts([table.get("file")]):
            yield "zone_file", name, lambda file: [file]
    for page in _tables(tables.get("page")):
        for key in OF_PAGES:
            for name in _texts([page.get(key)]):
                yield key, name, lambda file: [file]
        for part in (page, *_tables(page.get("group"))):
            for widget in _tables(part.get("widget")):
                routes = widget.get("routes")
                for name in _texts([routes.get("file")] if isinstance(routes, dict) else []):
                    yield "routes", name, lambda file: [file]


def _tables(value: Any) -> list[dict[str, Any]]:
    return [table for table in value if isinstance(table, dict)] if isinstance(value, list) else []


def _texts(value: Any) -> list[str]:
    return (
        [element for element in value if isinstance(element, str) and element]
        if isinstance(value, list)
        else []
    )

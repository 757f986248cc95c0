"""Copies the interface definitions of ROS packages, and those of the packages that they need.

A source is a folder (a package, a workspace, a checkout, an installed prefix) or a zip file, such as a
wheel. Only `.msg`, `.srv` and `.action` files are copied.
"""

import os
import shutil
import tempfile
import zipfile
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Final

from app.ros.messages.definitions import Definitions, Structure
from app.ros.messages.packages import PACKAGE_XML, definition_files, package_name, read_folders
from app.ros.messages.parsing import KINDS
from app.system.errors import InterfaceError

DEEPEST: Final = 6  # folders from the source to a package, as in <prefix>/lib/python3/site-packages/…
MOST_FILES: Final = 5_000  # in a zip file
MOST_BYTES: Final = 1_000_000  # of a definition
_NOT_SEARCHED: Final = ("build", "log", "node_modules", "__pycache__")
_SUFFIXES: Final = tuple(f".{kind}" for kind in KINDS)


@dataclass(frozen=True, slots=True)
class CopiedPackage:
    """A package that was copied, with its number of files by kind ("msg", "srv", "action").
    `changed`: the files differ from those that were there before. `needed_by`: it was not asked for."""

    name: str
    counts: Mapping[str, int]
    changed: bool
    needed_by: str = ""


@dataclass(frozen=True, slots=True)
class Copied:
    """`missing` has each package that is neither known nor in the source → one that needs it."""

    packages: Sequence[CopiedPackage]
    missing: Mapping[str, str]


@contextmanager
def opened_source(source: Path) -> Iterator[Path]:
    """The source as a folder. InterfaceError if it is neither a folder nor a zip file."""
    if source.is_dir():
        yield source
        return
    if not source.is_file() or not zipfile.is_zipfile(source):
        fault = "is no zip file or wheel" if source.is_file() else "is not there"
        raise InterfaceError(
            f"{source} {fault}: it must be a folder (a package, a workspace, an installed prefix) or a"
            " wheel"
        )
    with tempfile.TemporaryDirectory() as name:
        _extract(source, Path(name))
        yield Path(name)


def _extract(source: Path, folder: Path) -> None:
    with zipfile.ZipFile(source) as archive:
        wanted = [
            entry
            for entry in archive.infolist()
            if entry.filename.endswith((*_SUFFIXES, f"/{PACKAGE_XML}")) and not entry.is_dir()
        ]
        if len(wanted) > MOST_FILES:
            raise InterfaceError(
                f"{source} has {len(wanted)} definitions; {MOST_FILES} at most are read"
            )
        for entry in wanted:
            path = PurePosixPath(entry.filename)
            if path.is_absolute() or ".." in path.parts:
                raise InterfaceError(f"{source} has a file outside of itself: {entry.filename}")
            if entry.file_size > MOST_BYTES:
                raise InterfaceError(f"{source}: {entry.filename} is too large for a definition")
            target = folder / path
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(archive.read(entry))


CATKIN: Final = b"<buildtool_depend>catkin</buildtool_depend>"


def find_packages(folder: Path) -> dict[str, Path]:
    """The packages with interfaces in a folder and below it, by name; of several with one name that
    nearest to the folder."""
    named: dict[str, Path] = {}
    near = [folder]
    for _ in range(DEEPEST + 1):
        below: list[Path] = []
        for place in near:
            is_package = (place / PACKAGE_XML).is_file() or any((place / k).is_dir() for k in KINDS)
            if is_package and any(definition_files(place)):
                named.setdefault(package_name(place), place)
                continue
            below += _subfolders(place)
        near = below
    return named


def _subfolders(folder: Path) -> list[Path]:
    try:
        with os.scandir(folder) as entries:
            return sorted(
                Path(entry.path)
                for entry in entries
                if not entry.name.startswith(".") and entry.name not in _NOT_SEARCHED and entry.is_dir()
            )
    except OSError:
        return []


def copy_packages(names: Sequence[str], source: Path, target: Path, known: Collection[str]) -> Copied:
    """Copies packages from a source's folder (see `opened_source`) to folders of their names in
    `target`, and after them those that they need and that are not among the `known` packages.

    A package replaces the one that was there before, whole or not at all. InterfaceError if the source
    does not have a package that was asked for, or has a definition that can't be read; OSError if a
    file can't be written.
    """
    there = find_packages(source)
    if absent := [name for name in names if name not in there]:
        has = f"it has {', '.join(sorted(there))}" if there else "it has no interfaces"
        raise InterfaceError(f"there is no package {absent[0]} in the source: {has}")
    copied: list[CopiedPackage] = []
    missing: dict[str, str] = {}
    pending = {name: "" for name in names}
    while pending:
        name, needed_by = next(iter(pending.items()))
        del pending[name]
        read = _check_package(there[name])
        copied.append(_copy(name, there[name], target, needed_by))
        done = {package.name for package in copied}
        for need in sorted(_needed(read) - done - {*pending, *missing, *known, name}):
            if need in there:
                pending[need] = name
            else:
                missing[need] = name
    return Copied(copied, missing)


def _check_package(package: Path) -> Definitions:
    """The package's definitions; InterfaceError if one of them can't be read, or if it is of ROS 1."""
    about = package / PACKAGE_XML
    if about.is_file() and CATKIN in about.read_bytes():
        raise InterfaceError(
            f"{package_name(package)} is a package of ROS 1 (its package.xml names catkin): name "
            "the source of the robot's ROS 2 package"
        )
    definitions = read_folders([package])
    if definitions.unusable:
        raise next(iter(definitions.unusable.values()))
    return definitions


def _needed(definitions: Definitions) -> set[str]:
    """The packages of the types of all fields."""
    structures: list[Structure] = list(definitions.structures.values())
    return {need.partition("/")[0] for each in structures for _, need in each.nested_fields()}


def _copy(name: str, package: Path, target: Path, needed_by: str) -> CopiedPackage:
    files = {f"{file.suffix[1:]}/{file.name}": file.read_bytes() for file in definition_files(package)}
    counts = {kind: sum(path.startswith(f"{kind}/") for path in files) for kind in KINDS}
    place = target / name
    before = {file.relative_to(place).as_posix(): file.read_bytes() for file in definition_files(place)}
    if before != files:
        write_package(place, files)
    return CopiedPackage(name, counts, before != files, needed_by)


def write_package(place: Path, files: Mapping[str, bytes]) -> None:
    """Writes the files of a package (path in it → text), in place of those that were there before."""
    place.parent.mkdir(parents=True, exist_ok=True)
    draft = Path(tempfile.mkdtemp(prefix=f".{place.name}.", dir=place.parent))
    try:
        draft.chmod(0o755)
        for path, data in files.items():
            (draft / path).parent.mkdir(exist_ok=True)
            (draft / path).write_bytes(data)
        old = place.with_name(f".{place.name}.old")
        shutil.rmtree(old, ignore_errors=True)
        if place.exists():
            place.rename(old)
        draft.rename(place)
        shutil.rmtree(old, ignore_errors=True)
    except OSError:
        shutil.rmtree(draft, ignore_errors=True)
        raise

"""Finds ROS packages in folders, and reads their interface definitions."""

import os
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from difflib import get_close_matches
from pathlib import Path
from typing import Final

from app.ros.messages.definitions import Definitions, Structure, interface_name
from app.ros.messages.derived import EVENT_INFO
from app.ros.messages.parsing import KINDS, parse_definition
from app.system.errors import InterfaceError

# Finds ROS packages in folders, and the files of their interfaces.

_PACKAGE_NAME: Final = re.compile(r"<name>\s*([^<\s]+)\s*</name>")
PACKAGE_XML: Final = "package.xml"
# Where a folder has packages: itself, its subfolders, `share` of a merged install folder, and `share`
# of each package in an isolated one.
_PLACES: Final = (".", "*", "share/*", "*/share/*")
DEEPEST: Final = 4  # folders from a package to its interfaces
DEEPEST_UNREAD: Final = 6  # folders from a folder of the panel to a file that is not read
_SUFFIXES: Final = tuple(f".{kind}" for kind in KINDS)


def packages(folder: Path) -> Iterator[Path]:
    """The packages that have interfaces: folders with a package.xml, and others with a folder `msg`,
    `srv` or `action`."""
    for package in _places(folder):
        if any(definition_files(package)):
            yield package


def definition_files(package: Path) -> Iterator[Path]:
    """The files of a package's interfaces: those in its `msg`, `srv` and `action`, then those in other
    folders. Of a type that is in `msg` and elsewhere too, that in `msg`.

    rosidl installs a package's `srv/arm/Move.srv` as `arm/Move.srv`; both are the type
    `<package>/srv/Move`.
    """
    usual: set[str] = set()
    for kind in KINDS:
        for file in sorted((package / kind).glob(f"*.{kind}")):
            usual.add(file.name)
            yield file
    for file in _deeper_files(package, _SUFFIXES):
        if file.name not in usual:
            yield file


def file_stamps(folders: Sequence[Path]) -> tuple[tuple[Path, int, int], ...]:
    """(path, mtime in ns, size) of each file of the folders; differs when a file has changed."""
    files = [file for folder in folders for each in packages(folder) for file in definition_files(each)]
    return tuple((file, *_mtime_and_size(file)) for file in files)


def package_files(folder: Path) -> list[Path]:
    """The files of a folder by which its packages are known: their definitions and package.xml."""
    return [
        file
        for package in packages(folder)
        for file in (*definition_files(package), package / PACKAGE_XML)
        if file.is_file()
    ]


def package_name(package: Path) -> str:
    """The package's name from its package.xml, else from its folder."""
    try:
        match = _PACKAGE_NAME.search((package / PACKAGE_XML).read_text())
    except (OSError, UnicodeDecodeError):
        match = None
    return match[1] if match else package.resolve().name


def find_idl_only(folders: Sequence[Path]) -> dict[str, Path]:
    """Type → file of the interfaces that exist as `.idl` only."""
    files = {}
    for package in (place for folder in folders for place in _places(folder)):
        for file in _idl_files(package):
            if not any(file.with_suffix(suffix).is_file() for suffix in _SUFFIXES):
                for kind in [file.parent.name] if file.parent.name in KINDS else KINDS:
                    files[f"{package_name(package)}/{kind}/{file.stem}"] = file
    return files


def idl_hint(file: Path, kind: str = "") -> str:
    """The message about an interface that exists as `.idl` only."""
    return f"{file} is not read, as no .idl is: put {file.stem}.{kind or file.parent.name} beside it"


def find_unread(folders: Sequence[Path], type_name: str) -> Path | None:
    """A file below a folder of the package's name, of which this type was expected."""
    package, _, rest = type_name.partition("/")
    kind, _, stem = rest.partition("/")
    for folder in folders if kind in KINDS else ():
        for file in _walk(folder, (f".{kind}",), DEEPEST_UNREAD, into_packages=True):
            if file.stem == stem and package in file.resolve().parts:
                return file
    return None


def unread_hint(file: Path) -> str:
    """The message about a file that is in no package."""
    kind = file.suffix[1:]
    where = f"its package needs a {PACKAGE_XML}, or the file must be in <package>/{kind}"
    return f"{file} is not read as this type: {where}"


def _mtime_and_size(file: Path) -> tuple[int, int]:
    try:
        about = file.stat()
    except OSError:  # reading it will raise the error
        return 0, 0
    return about.st_mtime_ns, about.st_size


def _places(folder: Path) -> Iterator[Path]:
    """The folders that are packages. A folder in a package with a package.xml is a part of it, unless
    it has one too."""
    known: set[Path] = set()
    for pattern in _PLACES:
        for place in [folder] if pattern == "." else sorted(folder.glob(pattern)):
            if (place / PACKAGE_XML).is_file():
                known.add(place)
                yield place
            elif known.isdisjoint(place.parents) and any((place / kind).is_dir() for kind in KINDS):
                yield place


def _deeper_files(package: Path, suffixes: tuple[str, ...]) -> Iterator[Path]:
    """Files below a package: anywhere with a package.xml, else below `msg`, `srv` and `action`."""
    if (package / PACKAGE_XML).is_file():
        yield from _walk(package, suffixes, DEEPEST)
    else:
        for kind in KINDS:
            yield from _walk(package / kind, suffixes, DEEPEST - 1)


def _idl_files(package: Path) -> Iterator[Path]:
    return _deeper_files(package, (".idl",))


def _walk(
    folder: Path, suffixes: tuple[str, ...], deepest: int, *, into_packages: bool = False
) -> Iterator[Path]:
    """The files with one of these suffixes in a folder and `deepest` folders below it, by name; those
    of another package only if asked for."""
    with suppress(OSError), os.scandir(folder) as entries:
        for entry in sorted(entries, key=lambda entry: entry.name):
            path = Path(entry.path)
            if entry.name.endswith(suffixes) and entry.is_file():
                yield path
            elif (
                deepest
                and not entry.name.startswith(".")
                and entry.is_dir()
                and (into_packages or not (path / PACKAGE_XML).is_file())
            ):
                yield from _walk(path, suffixes, deepest - 1, into_packages=into_packages)


# Reads interface definitions from folders of ROS packages.


def read_folders(folders: Sequence[Path]) -> Definitions:
    """All interfaces in folders of ROS packages, such as a workspace's `share`.

    Files that can't be read, and types that two folders define differently, are `unusable`.
    `usable_definitions` checks references. InterfaceError if a folder has no interfaces.
    """
    definitions = Definitions()
    for folder in folders:
        in_it = list(packages(folder))
        if not in_it:
            why = "has no interfaces: they must be in <package>/msg/*.msg, srv/*.srv, action/*.action"
            hint = "".join(f"; {idl_hint(file)}" for file in list(find_idl_only([folder]).values())[:1])
            raise InterfaceError(f"{folder} {why}{hint}", folder)
        for package in in_it:
            name = package_name(package)
            for file in definition_files(package):
                _add_file(definitions, file, name)
    return definitions.excluding(definitions.unusable)


def _read_file(file: Path, package: str) -> Definitions:
    try:
        text = file.read_text("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InterfaceError(f"{file} can't be read: {_error_text(error)}", file) from error
    return parse_definition(text, package, file.suffix[1:], file.stem, file)


def _error_text(error: OSError | UnicodeDecodeError) -> str:
    return str(error.strerror) if isinstance(error, OSError) else "it is not UTF-8"


def _add_file(definitions: Definitions, file: Path, package: str) -> None:
    """Adds the definitions of a file to `definitions`, or its error."""
    try:
        read = _read_file(file, package)
        for name, structure in read.structures.items():
            known = definitions.structures.get(name, structure)
            if known != structure:
                why = f"{name} is defined here and, differently, in {known.source}"
                raise InterfaceError(f"{file}: {why}", file)
    except InterfaceError as error:
        definitions.unusable.setdefault(f"{package}/{file.suffix[1:]}/{file.stem}", error)
        return
    definitions.structures.update(read.structures)
    definitions.interface_types.update(read.interface_types)


def usable_definitions(
    definitions: Definitions, known: Definitions, unread: Mapping[str, Path]
) -> Definitions:
    """The usable definitions of both; `definitions` take precedence. `unread` as of `find_idl_only`.

    Unusable are interfaces that reference missing or unusable ones, and those that contain themselves.
    Without service events in the distribution (humble), events and the hashes of services and actions
    are left out.
    """
    every = (known | _without_unusable_events(definitions, known)).excluding(definitions.unusable)
    while left_out := _missing_types(every, unread) or _recursive_types(every.structures):
        every = every.excluding(left_out)
    return every


def _missing_types(every: Definitions, unread: Mapping[str, Path]) -> dict[str, InterfaceError]:
    """The errors of interfaces that reference missing structures."""
    return {
        interface_name(structure.name): _missing_type_error(structure, field.name, need, every, unread)
        for structure in every.structures.values()
        for field, need in structure.nested_fields()
        if need not in every.structures
    }


def _missing_type_error(
    structure: Structure, field: str, need: str, every: Definitions, unread: Mapping[str, Path]
) -> InterfaceError:
    why = f'{structure.source or structure.name}: field "{field}" is of type {need}, which '
    if (cause := every.unusable.get(interface_name(need))) is not None:
        return InterfaceError(f"{why}can't be used: {cause}", cause.source)
    near = get_close_matches(need, every.structures, n=1)
    hint = f"; did you mean {near[0]}?" if near else ": its package must be in a folder too"
    hint = f": {idl_hint(unread[need])}" if need in unread else hint
    return InterfaceError(f"{why}is not there{hint}", structure.source)


def _recursive_types(every: Mapping[str, Structure]) -> dict[str, InterfaceError]:
    """The errors of interfaces that contain themselves, directly or through others."""
    done: set[str] = set()
    errors: dict[str, InterfaceError] = {}

    def visit(structure: Structure, above: tuple[str, ...]) -> None:
        path = (*above, structure.name)
        if structure.name in above:
            why = f"{structure.name} contains itself ({' → '.join(path)})"
            error = InterfaceError(f"{structure.source}: {why}", structure.source)
            errors[interface_name(structure.name)] = error
        elif structure.name not in done:
            for _, need in structure.nested_fields():
                visit(every[need], path)
            done.add(structure.name)

    for structure in every.values():
        visit(structure, ())
    return errors


def complete_definitions(definitions: Definitions, known: Definitions) -> Definitions:
    """The files of `definitions` whose references all exist in them or in `known`."""
    definitions = _without_unusable_events(definitions, known)
    while lacking := _incomplete_files(definitions, known):
        definitions = Definitions(
            _excluding_files(definitions.structures, lacking),
            _excluding_files(definitions.interface_types, lacking),
        )
    return definitions


def _without_unusable_events(definitions: Definitions, known: Definitions) -> Definitions:
    """The definitions without service events if their type does not exist."""
    if EVENT_INFO in known.structures or EVENT_INFO in definitions.structures:
        return definitions
    return Definitions(
        {
            n: s
            for n, s in definitions.structures.items()
            if EVENT_INFO not in {need for _, need in s.nested_fields()}
        },
        unusable=definitions.unusable,
    )


def _incomplete_files(definitions: Definitions, known: Definitions) -> set[Path | None]:
    every = known.structures.keys() | definitions.structures.keys()
    return {
        s.source
        for s in definitions.structures.values()
        if any(n not in every for _, n in s.nested_fields())
    }


def _excluding_files(
    structures: Mapping[str, Structure], files: set[Path | None]
) -> dict[str, Structure]:
    return {name: structure for name, structure in structures.items() if structure.source not in files}

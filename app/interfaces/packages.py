"""Reads interface definitions from folders of ROS packages. The only module of this room that reads
files."""

import re
from collections.abc import Iterator, Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Final

from app.errors import InterfaceError
from app.interfaces.definitions import Definitions, Structure, interface_name
from app.interfaces.derived_types import EVENT_INFO
from app.interfaces.parsing import KINDS, parse_definition

_PACKAGE_NAME: Final = re.compile(r"<name>\s*([^<\s]+)\s*</name>")
# Where a folder has packages: itself, its subfolders, `share` of a merged install folder, and `share`
# of each package in an isolated one.
_PLACES: Final = (".", "*", "share/*", "*/share/*")


def read_folders(folders: Sequence[Path]) -> Definitions:
    """All interfaces in folders of ROS packages, such as a workspace's `share`.

    Files that can't be read, and types that two folders define differently, are `unusable`.
    `usable_definitions` checks references. InterfaceError if a folder has no interfaces.
    """
    found = Definitions()
    for folder in folders:
        packages = list(_packages(folder))
        if not packages:
            why = "has no interfaces: they must be in <package>/msg/*.msg, srv/*.srv, action/*.action"
            hint = "".join(f"; {idl_hint(file)}" for file in list(find_idl_only([folder]).values())[:1])
            raise InterfaceError(f"{folder} {why}{hint}", folder)
        for package in packages:
            name = _package_name(package)
            for file in _files(package):
                _add_file(found, file, name)
    return found.excluding(found.unusable)


def file_stamps(folders: Sequence[Path]) -> tuple[tuple[Path, int, int], ...]:
    """(path, mtime in ns, size) of each file of the folders; differs when a file has changed."""
    files = [file for folder in folders for package in _packages(folder) for file in _files(package)]
    return tuple((file, *_mtime_and_size(file)) for file in files)


def package_files(folder: Path) -> list[Path]:
    """The files of a folder by which its packages are known: their definitions and package.xml."""
    return [
        file
        for package in _packages(folder)
        for file in (*_files(package), package / "package.xml")
        if file.is_file()
    ]


def _mtime_and_size(file: Path) -> tuple[int, int]:
    try:
        about = file.stat()
    except OSError:  # reading it will raise the error
        return 0, 0
    return about.st_mtime_ns, about.st_size


def find_idl_only(folders: Sequence[Path]) -> dict[str, Path]:
    """Type → file of the interfaces that exist as `.idl` only."""
    found = {}
    for place in (place for folder in folders for place in _places(folder)):
        for kind in KINDS:
            for file in sorted((place / kind).glob("*.idl")):
                if not file.with_suffix(f".{kind}").is_file():
                    found[f"{_package_name(place)}/{kind}/{file.stem}"] = file
    return found


def idl_hint(file: Path) -> str:
    """The message about an interface that exists as `.idl` only."""
    return f"{file} is not read, as no .idl is: put {file.stem}.{file.parent.name} beside it"


def _places(folder: Path) -> Iterator[Path]:
    for place in _PLACES:
        yield from [folder] if place == "." else sorted(folder.glob(place))


def _packages(folder: Path) -> Iterator[Path]:
    for package in _places(folder):
        if any((package / kind).is_dir() for kind in KINDS) and any(_files(package)):
            yield package


def _files(package: Path) -> Iterator[Path]:
    for kind in KINDS:
        yield from sorted((package / kind).glob(f"*.{kind}"))


def _package_name(package: Path) -> str:
    """The package's name from its package.xml, else from its folder."""
    try:
        match = _PACKAGE_NAME.search((package / "package.xml").read_text())
    except (OSError, UnicodeDecodeError):
        match = None
    return match[1] if match else package.resolve().name


def _read_file(file: Path, package: str) -> Definitions:
    try:
        text = file.read_text("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InterfaceError(f"{file} can't be read: {_error_text(error)}", file) from error
    return parse_definition(text, package, file.suffix[1:], file.stem, file)


def _error_text(error: OSError | UnicodeDecodeError) -> str:
    return str(error.strerror) if isinstance(error, OSError) else "it is not UTF-8"


def _add_file(found: Definitions, file: Path, package: str) -> None:
    """Adds the definitions of a file to `found`, or its error."""
    try:
        read = _read_file(file, package)
        for name, structure in read.structures.items():
            known = found.structures.get(name, structure)
            if known != structure:
                why = f"{name} is defined here and, differently, in {known.source}"
                raise InterfaceError(f"{file}: {why}", file)
    except InterfaceError as error:
        found.unusable.setdefault(f"{package}/{file.suffix[1:]}/{file.stem}", error)
        return
    found.structures.update(read.structures)
    found.interface_types.update(read.interface_types)


def usable_definitions(
    found: Definitions, known: Definitions, unread: Mapping[str, Path]
) -> Definitions:
    """The usable definitions of `known` and `found`; `found` takes precedence. `unread` as of
    `find_idl_only`.

    Unusable are interfaces that reference missing or unusable ones, and those that contain themselves.
    Without service events in the distribution (humble), events and the hashes of services and actions
    are left out.
    """
    every = (known | _without_unusable_events(found, known)).excluding(found.unusable)
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
    found: dict[str, InterfaceError] = {}

    def visit(structure: Structure, above: tuple[str, ...]) -> None:
        path = (*above, structure.name)
        if structure.name in above:
            why = f"{structure.name} contains itself ({' → '.join(path)})"
            error = InterfaceError(f"{structure.source}: {why}", structure.source)
            found[interface_name(structure.name)] = error
        elif structure.name not in done:
            for _, need in structure.nested_fields():
                visit(every[need], path)
            done.add(structure.name)

    for structure in every.values():
        visit(structure, ())
    return found


def complete_definitions(found: Definitions, known: Definitions) -> Definitions:
    """The files of `found` whose references all exist in `found` or `known`."""
    found = _without_unusable_events(found, known)
    while lacking := _incomplete_files(found, known):
        found = Definitions(
            _excluding_files(found.structures, lacking),
            _excluding_files(found.interface_types, lacking),
        )
    return found


def _without_unusable_events(found: Definitions, known: Definitions) -> Definitions:
    """`found` without service events if their type does not exist."""
    if EVENT_INFO in known.structures or EVENT_INFO in found.structures:
        return found
    return Definitions(
        {
            n: s
            for n, s in found.structures.items()
            if EVENT_INFO not in {need for _, need in s.nested_fields()}
        },
        unusable=found.unusable,
    )


def _incomplete_files(found: Definitions, known: Definitions) -> set[Path | None]:
    every = known.structures.keys() | found.structures.keys()
    return {
        s.source for s in found.structures.values() if any(n not in every for _, n in s.nested_fields())
    }


def _excluding_files(
    structures: Mapping[str, Structure], files: set[Path | None]
) -> dict[str, Structure]:
    return {name: one for name, one in structures.items() if one.source not in files}

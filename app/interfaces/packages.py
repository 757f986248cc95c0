"""Reads interface definitions from folders of ROS packages."""

from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path

from app.errors import InterfaceError
from app.interfaces.definitions import Definitions, Structure, interface_name
from app.interfaces.derived_types import EVENT_INFO
from app.interfaces.package_folders import (
    definition_files,
    find_idl_only,
    idl_hint,
    package_name,
    packages,
)
from app.interfaces.parsing import parse_definition


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

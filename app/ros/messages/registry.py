"""The ROS 2 interfaces of a panel: lookup, encoding and decoding."""

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from difflib import get_close_matches
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

from app.ros.cdr.codec import Codec
from app.ros.cdr.fields import FieldReader, RowReader
from app.ros.cdr.reader import LITTLE_ENDIAN_HEADER
from app.ros.cdr.selection import Resolver
from app.ros.messages.definitions import Definitions, Structure, Type, interface_name
from app.ros.messages.derived import ActionTypes, action_types, type_hash
from app.ros.messages.distributions import read_distribution
from app.ros.messages.field_path import PathStep, field_call
from app.ros.messages.mcap_schema import definition_text
from app.ros.messages.packages import (
    file_stamps,
    find_idl_only,
    find_unread,
    idl_hint,
    read_folders,
    unread_hint,
    usable_definitions,
)
from app.ros.messages.validation import Check, field_check, message_check
from app.system.errors import DecodeError, InterfaceError

MAX_SUGGESTIONS: Final = 3
FILE_PARTS: Final = 3  # of a definition's file that are shown: package, folder, name
NO_DEFINITIONS: Final = Definitions()
PACKAGE_SIMILARITY: Final = 0.8  # high, because most package names end in "_msgs"
MISSPELT_PACKAGE: Final = 0.81  # so similar is a name only by mistake; "my_msgs" is not like "map_msgs"


class Interfaces:
    """The message, service and action types of one distribution and of folders of packages.

    A message type is "package/msg/Name". Parts of services and actions are message types too, named as
    in ROS: "std_srvs/srv/SetBool_Request", "example_interfaces/action/Fibonacci_Feedback".
    """

    def __init__(
        self,
        distro: str = "jazzy",
        folders: Sequence[Path] = (),
        described: Definitions = NO_DEFINITIONS,
    ) -> None:
        """`folders` are packages, or contain packages (a workspace's `share`); their definitions take
        precedence over the distribution's, and `described`, which a robot's nodes gave, over both. A
        file that can't be used is an error only when its type is requested: see `unusable`.
        InterfaceError names a folder without interfaces."""
        known = read_distribution(distro)
        if described.structures:
            known = known | described
        self._distro = distro
        self._folders = tuple(folders)
        self._idl_only = find_idl_only(folders)
        self._definitions = (
            usable_definitions(read_folders(folders) | described, known, self._idl_only)
            if folders
            else known
        )
        self._structures = self._definitions.structures
        self._codec = Codec(self._structures)
        self._checks: dict[str, Check] = {}
        self._hashes: dict[str, str] = {}
        self._resolver = Resolver(self._structures)
        self._field_readers: dict[tuple[str, tuple[str, ...]], FieldReader] = {}

    @property
    def structures(self) -> Mapping[str, Structure]:
        """The structure of every type that can be encoded, including parts of services and actions."""
        return self._structures

    @property
    def unusable(self) -> Mapping[str, InterfaceError]:
        """The error of each interface of the folders that can't be used, by name."""
        return self._definitions.unusable

    def require(self, type_name: str) -> None:
        """InterfaceError, with similar names, if the type does not exist."""
        if type_name not in self._structures:
            raise self._unknown_type_error(type_name, self._structures)

    def service_types(self, type_name: str) -> tuple[str, str]:
        """(request type, response type) of a service like "std_srvs/srv/SetBool"."""
        request, response = f"{type_name}_Request", f"{type_name}_Response"
        if request not in self._structures or response not in self._structures:
            raise self._unknown_type_error(
                type_name, self._service_or_action_names("/srv/"), "a service"
            )
        return request, response

    def action_types(self, type_name: str) -> ActionTypes:
        """The types of an action like "example_interfaces/action/Fibonacci"."""
        types = action_types(type_name)
        if types.feedback_message not in self._structures:
            raise self._unknown_type_error(
                type_name, self._service_or_action_names("/action/"), "an action"
            )
        return types

    def constants(self, type_name: str) -> Mapping[str, Any]:
        """Name → value (bool, int, float or str) of the constants in a type's definition."""
        self.require(type_name)
        return self._structures[type_name].constants

    def field_type(self, type_name: str, path: str) -> str:
        """The type at a path ("pose.position.x", "poses[0]"), as in a .msg file ("float64[36]")."""
        return str(self.type_at(type_name, path))

    def type_at(self, type_name: str, path: str) -> Type:
        """The same as `Type`; InterfaceError if the type has no such field."""
        self.require(type_name)
        return self._resolver.type_at(type_name, path)

    def typed_steps(self, type_name: str, path: str) -> tuple[PathStep, ...]:
        """The steps of a path, whose keys have the values that a message has: 5, not "5"."""
        self.require(type_name)
        return self._resolver.typed_steps(type_name, path)

    def field_reader(self, type_name: str, paths: Iterable[str]) -> FieldReader:
        """A reader of the fields at these paths, which skips the rest of each message.

        InterfaceError if the type has no such field.
        """
        self.require(type_name)
        key = type_name, tuple(dict.fromkeys(paths))
        if key not in self._field_readers:
            wanted = self._resolver.select(*key)
            calls = {path: call for path in key[1] if (call := field_call(path)) is not None}
            self._field_readers[key] = self._codec.field_reader(type_name, wanted, calls)
        return self._field_readers[key]

    def row_reader(
        self,
        type_name: str,
        path: str,
        fields: Sequence[str | None],
        most: int,
        last_later: bool = False,
    ) -> RowReader:
        """A reader of the fields of each element of the list at a path, up to `most` elements; None is
        the element itself. With `last_later` a row has a function that reads its last field.
        InterfaceError if the type has no such field."""
        self.require(type_name)
        wanted = self._resolver.select_rows(type_name, path, fields)
        return self._codec.row_reader(type_name, wanted, fields, most, last_later)

    def type_hash(self, type_name: str) -> str:
        """The REP 2016 type hash, `RIHS01_…`, of a message, a part, a service or an action.

        InterfaceError if the distribution has none: services and actions before iron.
        """
        if type_name not in self._hashes:
            self._hashes[type_name] = type_hash(self._find(type_name), self._find)
        return self._hashes[type_name]

    def source(self, type_name: str) -> str:
        """Where a definition comes from: its file below the folder of packages ("pkg/msg/Name.msg"), or
        the distribution."""
        structure = self._definitions.find(type_name)
        if structure is None or structure.source is None:
            return f"ROS 2 {self._distro}"
        return "/".join(structure.source.parts[-FILE_PARTS:])

    def definition(self, type_name: str) -> str:
        """The definition of a message and of all types in it, in the format "ros2msg"."""
        self.require(type_name)
        return definition_text(self._structures[type_name], self._structures.__getitem__)

    def encode(self, type_name: str, fields: Mapping[str, Any]) -> bytes:
        """The message as XCDR1 bytes with the encapsulation header (00 01 00 00).

        A field that is not given has its default, else zero. FieldError names a field that does not
        exist or does not fit its definition. Lists may be NumPy arrays, lists of 8-bit unsigned numbers
        `bytes`.
        """
        check = self._checks.get(type_name) or self._check(type_name)
        return self._codec.serialize(check(fields), type_name)

    def decode(self, type_name: str, data: bytes) -> Any:
        """The message object (fields as attributes). DecodeError if the bytes are no such message, or
        have too many elements to be decoded at once: see `field_reader`."""
        try:
            return self._codec.deserialize(data, type_name)
        except Exception as error:  # no received bytes may stop the panel
            raise DecodeError(f"{len(data)} bytes are not a {type_name}: {error}") from error

    def decode_whole(self, type_name: str, data: bytes) -> Any:
        """The same, of any number of elements: for commands, which have no screen to keep alive."""
        try:
            return self._codec.deserialize(data, type_name, whole=True)
        except Exception as error:  # whatever was received is an error of that kind
            raise DecodeError(f"{len(data)} bytes are not a {type_name}: {error}") from error

    def prepare_codecs(self, type_names: Iterable[str]) -> None:
        """Compiles the codecs of these types, so that the first press does not wait for it."""
        for type_name in type_names:
            self.type_hash(type_name)
            with suppress(DecodeError):
                self.decode(type_name, LITTLE_ENDIAN_HEADER)

    def _check(self, type_name: str) -> Check:
        if type_name not in self._checks:
            self.require(type_name)
            structure = self._structures[type_name]
            checks = [field_check(field.type, structure, self._check) for field in structure.fields]
            make = self._codec.message_class(type_name)
            self._checks[type_name] = message_check(structure, make, checks)
        return self._checks[type_name]

    def _find(self, type_name: str) -> Structure:
        definition = self._definitions.find(type_name)
        if definition is None:
            names = {*self._structures, *self._definitions.interface_types}
            raise self._unknown_type_error(type_name, names, "a type with a hash")
        return definition

    def _service_or_action_names(self, kind: str) -> list[str]:
        """The names of all services ("/srv/") or actions ("/action/")."""
        ending = "_Response" if kind == "/srv/" else "_FeedbackMessage"
        return [n.removesuffix(ending) for n in self._structures if kind in n and n.endswith(ending)]

    def _unknown_type_error(self, name: str, known: Any, noun: str = "an interface") -> InterfaceError:
        if (cause := self.unusable.get(interface_name(name))) is not None:
            return InterfaceError(f'"{name}" can\'t be used: {cause}', cause.source)
        if name in self._idl_only:
            hint = idl_hint(self._idl_only[name], name.split("/")[1])
            return InterfaceError(f'"{name}" is not there: {hint}')
        if (file := find_unread(self._folders, name)) is not None:
            return InterfaceError(f'"{name}" is not there: {unread_hint(file)}')
        why = f'"{name}" is not {noun} of ROS 2 {self._distro}'
        every, package = [*known, *self.unusable], name.partition("/")[0]
        near, packages = _suggestions(name, every), {known.partition("/")[0] for known in every}
        if near and (package in packages or get_close_matches(package, packages, 1, MISSPELT_PACKAGE)):
            return InterfaceError(f"{why}; did you mean {' or '.join(near)}?")
        if "/" not in name or package in packages:
            return InterfaceError(why)
        hint = f"there is no package {package}: its folder must be among the panel's `interfaces`"
        hint += f", or did you mean {' or '.join(near)}?" if near else ""
        # Without any folder, all of them are absent for one reason.
        mistake = package if self._folders else "no folders"
        return InterfaceError(f"{why}; {hint}", package=package, cause=mistake)


def _suggestions(name: str, known: Sequence[str]) -> list[str]:
    """Names similar to an unknown one: in its package or a similar package; then the same name in other
    packages."""
    package, _, rest = name.partition("/")
    packages = {known_name.partition("/")[0] for known_name in known}
    near: list[str] = []
    for each in get_close_matches(package, packages, n=1, cutoff=PACKAGE_SIMILARITY):
        own = [
            known_name.partition("/")[2] for known_name in known if known_name.startswith(f"{each}/")
        ]
        near += [f"{each}/{similar}" for similar in _similar(rest, own)]
    same = [known_name for known_name in known if known_name.endswith(f"/{rest}")]
    near += get_close_matches(name, same, n=MAX_SUGGESTIONS, cutoff=0)
    return list(dict.fromkeys(near))[:MAX_SUGGESTIONS]


def _similar(rest: str, known: Sequence[str]) -> list[str]:
    """The names whose last part is similar."""
    last = {known_name.rpartition("/")[2]: known_name for known_name in known}
    return [
        last[match] for match in get_close_matches(rest.rpartition("/")[2], last, n=MAX_SUGGESTIONS)
    ]


def load_interfaces(distro: str, folders: Sequence[Path] = ()) -> Interfaces:
    """The shared instance for a distribution and folders; it is read again when a file has changed."""
    return _cached_interfaces(distro, tuple(folders), file_stamps(folders))


@lru_cache(8)
def _cached_interfaces(distro: str, folders: tuple[Path, ...], _stamp: object) -> Interfaces:
    return Interfaces(distro, folders)

"""Interface definitions: structures of typed fields, constants and default values. No I/O."""

import keyword
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final, Literal

from app.system.errors import InterfaceError

INTEGER_RANGES: Final[Mapping[str, tuple[int, int]]] = {
    **{f"int{bits}": (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) for bits in (8, 16, 32, 64)},
    **{f"uint{bits}": (0, 2**bits - 1) for bits in (8, 16, 32, 64)},
    **dict.fromkeys(("byte", "char", "octet"), (0, 255)),
}
FLOAT_TYPES: Final = ("float32", "float64")
STRING_TYPES: Final = ("string", "wstring")
BASE_TYPES: Final = frozenset(("bool", *INTEGER_RANGES, *FLOAT_TYPES, *STRING_TYPES))

# The field of one byte that ROS adds to a message without fields.
PLACEHOLDER: Final = "structure_needs_at_least_one_member"


@dataclass(frozen=True, slots=True)
class Type:
    """A field's type; `str` writes it as a .msg file does ("float64", "string<=8[]", "int8[<=3]").

    `name` is a base type or like "std_msgs/msg/Header". `bound` is of a string's bytes (of a
    wstring's UTF-16 units), `size` of an array's or a sequence's elements; 0 is no bound.
    """

    name: str
    bound: int = 0
    container: Literal["one", "array", "sequence"] = "one"
    size: int = 0

    @property
    def is_nested(self) -> bool:
        return "/" in self.name

    @property
    def element(self) -> "Type":
        """The type of one element of an array or a sequence."""
        return replace(self, container="one", size=0)

    def __str__(self) -> str:
        element = f"{self.name}<={self.bound}" if self.bound else self.name
        match self.container:
            case "one":
                return element
            case "array":
                return f"{element}[{self.size}]"
        return f"{element}[<={self.size}]" if self.size else f"{element}[]"


def zero_value(kind: Type) -> Any:
    """The zero value of a type, as ROS initializes it: a plain value; `{}` for a nested structure."""
    match kind.container:
        case "sequence":
            return []
        case "array":
            return [zero_value(kind.element)] * kind.size
    if kind.is_nested:
        return {}
    return (
        False
        if kind.name == "bool"
        else ""
        if kind.name in STRING_TYPES
        else 0.0
        if kind.name in FLOAT_TYPES
        else 0
    )


def attribute_name(name: str) -> str:
    """A field's attribute in a message object: a Python keyword gets a "_" appended."""
    return f"{name}_" if keyword.iskeyword(name) else name


@dataclass(frozen=True, slots=True)
class Field:
    """A field of a structure; `default` is None if the definition has none."""

    name: str
    type: Type
    default: Any = None

    @property
    def attribute(self) -> str:
        """The field's attribute in a message object."""
        return attribute_name(self.name)

    @property
    def default_value(self) -> Any:
        """The plain value of a field that is not given: its default, else zero."""
        return zero_value(self.type) if self.default is None else self.default


@dataclass(frozen=True, slots=True)
class Structure:
    """A message, or a part of a service or an action; `source` is its file.
    `constant_types` has the base type of each constant."""

    name: str
    fields: tuple[Field, ...]
    constants: Mapping[str, Any] = field(default_factory=dict)
    source: Path | None = field(default=None, compare=False)
    constant_types: Mapping[str, str] = field(default_factory=dict, compare=False)

    def nested_fields(self) -> Iterator[tuple[Field, str]]:
        """(field, structure name) of each field whose type is a structure."""
        return ((field, field.type.name) for field in self.fields if field.type.is_nested)


@dataclass(frozen=True, slots=True)
class Definitions:
    """Structures by name.

    `interface_types` are services and actions as REP 2016 describes them: they are never sent, but have
    type hashes. `unusable` has the error of each interface that can't be used, by the interface's name
    (that of a service, not of its request).
    """

    structures: dict[str, Structure] = field(default_factory=dict)
    interface_types: dict[str, Structure] = field(default_factory=dict)
    unusable: dict[str, InterfaceError] = field(default_factory=dict)

    def __or__(self, over: "Definitions") -> "Definitions":
        """Both; `over` takes precedence."""
        return Definitions(
            self.structures | over.structures,
            self.interface_types | over.interface_types,
            self.unusable | over.unusable,
        )

    def excluding(self, left_out: Mapping[str, InterfaceError]) -> "Definitions":
        """The definitions without these interfaces."""
        return Definitions(
            {
                name: structure
                for name, structure in self.structures.items()
                if interface_name(name) not in left_out
            },
            {
                name: definition
                for name, definition in self.interface_types.items()
                if interface_name(name) not in left_out
            },
            self.unusable | {**left_out},
        )

    def find(self, name: str) -> Structure | None:
        return self.structures.get(name) or self.interface_types.get(name)


def interface_name(name: str) -> str:
    """The interface of a structure: "cell_msgs/srv/Change" for "cell_msgs/srv/Change_Request". The name
    of an interface has no "_"."""
    package, _, rest = name.rpartition("/")
    return f"{package}/{rest.partition('_')[0]}"

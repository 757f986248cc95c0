"""What interfaces are made of: structures of typed fields with constants and defaults. No I/O."""

import keyword
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final, Literal

from app.errors import InterfaceError

INTEGER_RANGES: Final[Mapping[str, tuple[int, int]]] = {
    **{f"int{bits}": (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) for bits in (8, 16, 32, 64)},
    **{f"uint{bits}": (0, 2**bits - 1) for bits in (8, 16, 32, 64)},
    **dict.fromkeys(("byte", "char", "octet"), (0, 255)),
}
FLOAT_TYPES: Final = ("float32", "float64")
STRING_TYPES: Final = ("string", "wstring")
BASE_TYPES: Final = frozenset(("bool", *INTEGER_RANGES, *FLOAT_TYPES, *STRING_TYPES))

# What ROS puts into a message without fields, so that it has one byte.
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
        one = f"{self.name}<={self.bound}" if self.bound else self.name
        match self.container:
            case "one":
                return one
            case "array":
                return f"{one}[{self.size}]"
        return f"{one}[<={self.size}]" if self.size else f"{one}[]"


def zero_value(kind: Type) -> Any:
    """What a field of a type has that nobody gave a value, as ROS makes it: a plain value, of another
    structure a table without fields."""
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
    """A field's name in a message object: a keyword of Python's gets a "_" after it."""
    return f"{name}_" if keyword.iskeyword(name) else name


@dataclass(frozen=True, slots=True)
class Field:
    """`default` is None where the definition has none."""

    name: str
    type: Type
    default: Any = None

    @property
    def attribute(self) -> str:
        """The field's name in a message object."""
        return attribute_name(self.name)

    @property
    def default_value(self) -> Any:
        """The plain value of a field that a message leaves out: its default, else zero."""
        return zero_value(self.type) if self.default is None else self.default


@dataclass(frozen=True, slots=True)
class Structure:
    """A message, or a part of a service or an action; `source` is the file it was read from.
    `constant_types` has the base type of each constant."""

    name: str
    fields: tuple[Field, ...]
    constants: Mapping[str, Any] = field(default_factory=dict)
    source: Path | None = field(default=None, compare=False)
    constant_types: Mapping[str, str] = field(default_factory=dict, compare=False)

    def nested_fields(self) -> Iterator[tuple[Field, str]]:
        """Each field whose type is another structure, with that one's name."""
        return ((one, one.type.name) for one in self.fields if one.type.is_nested)


@dataclass(frozen=True, slots=True)
class Definitions:
    """Structures by name. `wholes` are services and actions as REP 2016 describes them: nothing
    that is ever sent, but what their type hashes are of. `left_out` has why an interface can't be
    used, by its name: that of a service, and not that of its request."""

    structures: dict[str, Structure] = field(default_factory=dict)
    interface_types: dict[str, Structure] = field(default_factory=dict)
    unusable: dict[str, InterfaceError] = field(default_factory=dict)

    def __or__(self, over: "Definitions") -> "Definitions":
        """Both; where both have a name, it is as in `over`."""
        return Definitions(
            self.structures | over.structures,
            self.interface_types | over.interface_types,
            self.unusable | over.unusable,
        )

    def excluding(self, left_out: Mapping[str, InterfaceError]) -> "Definitions":
        """What is left where these interfaces can't be used."""
        return Definitions(
            {
                name: one
                for name, one in self.structures.items()
                if interface_name(name) not in left_out
            },
            {
                name: one
                for name, one in self.interface_types.items()
                if interface_name(name) not in left_out
            },
            self.unusable | {**left_out},
        )

    def find(self, name: str) -> Structure | None:
        return self.structures.get(name) or self.interface_types.get(name)


def interface_name(name: str) -> str:
    """What the file of a structure defines: "cell_msgs/srv/Change", for its "…/Change_Request". No
    interface has a "_" in its own name."""
    package, _, rest = name.rpartition("/")
    return f"{package}/{rest.partition('_')[0]}"

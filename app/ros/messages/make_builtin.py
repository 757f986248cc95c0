"""`python -m app.ros.messages.make_builtin`: writes `builtin/messages.json` from the messages of
rosbags.

Run it after rosbags is renewed in the lock files; a test compares the file. It has a row for each
definition, with all distributions that define the message like this.
"""

import json
from collections.abc import Iterator, Mapping
from dataclasses import astuple, replace
from typing import Any, Final, Literal

from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore

from app.ros.messages.definitions import PLACEHOLDER, Field, Structure, Type
from app.ros.messages.distributions import DISTROS, MESSAGES

# Rolling uses the messages of the newest distribution that rosbags knows.
ALIASES: Final[Mapping[str, str]] = {"rolling": "lyrical"}

# rosbags drops default values; these are all that its messages have in ROS.
DEFAULTS: Final[Mapping[str, Mapping[str, Any]]] = {
    "geometry_msgs/msg/Quaternion": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
    "rcl_interfaces/msg/ParameterDescriptor": {"read_only": False, "dynamic_typing": False},
    "sensor_msgs/msg/NavSatStatus": {"status": -2},
    "type_description_interfaces/msg/FieldType": {"type_id": 0},
}
NO_DEFAULTS: Final = {"humble": "sensor_msgs/msg/NavSatStatus", "iron": "sensor_msgs/msg/NavSatStatus"}


def rosbags_messages(distro: str) -> Iterator[Structure]:
    """The messages of a distribution, with their default values."""
    definitions = get_typestore(Stores(f"ros2_{ALIASES.get(distro, distro)}")).fielddefs
    for name, definition in definitions.items():
        defaults = {} if NO_DEFAULTS.get(distro) == name else DEFAULTS.get(name, {})
        yield _to_structure(name, definition, defaults)


def messages_text() -> str:
    """The text of the file: JSON with a line for each definition, by the messages' names."""
    distros: dict[str, list[str]] = {}
    for distro in DISTROS:
        for message in rosbags_messages(distro):
            distros.setdefault(_packed(message), []).append(distro)
    rows = (f"[{json.dumps(distros[packed])}, {packed}]" for packed in sorted(distros))
    return "[\n{}\n]\n".format(",\n".join(rows))


def _to_structure(name: str, definition: Any, defaults: Mapping[str, Any]) -> Structure:
    """A structure from rosbags' nested tuples: ([(name, type, value)…], [(field, type)…])."""
    constants, fields = definition
    return Structure(
        name,
        tuple(
            Field(each, _to_type(described), defaults.get(each))
            for each, described in fields
            if each != PLACEHOLDER
        ),
        {each: value for each, _, value in constants},
        constant_types={each: kind for each, kind, _ in constants},
    )


def _to_type(described: Any) -> Type:
    kind, detail = described
    if kind == Nodetype.NAME:
        return Type(detail)
    if kind == Nodetype.BASE:
        return Type(*detail)
    inner, size = detail
    container: Literal["array", "sequence"] = "array" if kind == Nodetype.ARRAY else "sequence"
    return replace(_to_type(inner), container=container, size=size)


def _packed(message: Structure) -> str:
    """Name, fields and constants as JSON."""
    fields = [[field.name, field.default, *_type_parts(field.type)] for field in message.fields]
    types = message.constant_types
    constants = [[types[name], name, value] for name, value in message.constants.items()]
    return json.dumps([message.name, fields, constants])[1:-1]


def _type_parts(kind: Type) -> list[Any]:
    """The attributes of a type, without those at its end that are as by default."""
    parts = list(astuple(kind))
    usual = list(astuple(Type(kind.name)))
    while parts[1:] and parts[-1] == usual[len(parts) - 1]:
        parts.pop()
    return parts


if __name__ == "__main__":
    MESSAGES.write_text(messages_text())

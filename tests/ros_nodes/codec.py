"""ROS 2's own codec (rclpy, the type support of rmw_fastrtps), driven by JSON lines: see `commands.py`.

Bytes are in base64. Fields are plain JSON values, NaN and Infinity as Python's json has them; a byte
is a number.
"""

import base64
from importlib import import_module
from types import SimpleNamespace
from typing import Any

import numpy
import rclpy
from commands import obey
from rclpy.serialization import deserialize_message, serialize_message
from rosidl_parser.definition import AbstractNestedType, Array, BasicType, NamespacedType

PLACEHOLDER = "structure_needs_at_least_one_member"  # the only field of a message without fields

# rclpy keeps fixed arrays of these as NumPy arrays.
DTYPES = {"float": numpy.float32, "double": numpy.float64} | {
    name: numpy.dtype(name) for bits in (8, 16, 32, 64) for name in (f"int{bits}", f"uint{bits}")
}


def class_of(type_name: str) -> Any:
    """Of a message, and of a part of a service or an action ("pkg/srv/Name_Request")."""
    package, kind, name = type_name.split("/")
    whole = getattr(import_module(f"{package}.{kind}"), name.partition("_")[0])
    return getattr(import_module(whole.__module__), name)


def plain(value: Any) -> Any:
    if hasattr(value, "get_fields_and_field_types"):
        names = [name for name in value.get_fields_and_field_types() if name != PLACEHOLDER]
        return {name: plain(getattr(value, name)) for name in names}
    if isinstance(value, bytes):
        return value[0]
    if isinstance(value, dict):
        return {name: plain(item) for name, item in value.items()}
    if isinstance(value, numpy.generic):
        return value.item()
    if isinstance(value, (str, bool, int, float)):
        return value
    return [plain(item) for item in value]


def message_of(message_class: Any, fields: dict[str, Any]) -> Any:
    message = message_class()
    names = message_class.get_fields_and_field_types()
    for name, slot in zip(names, message_class.SLOT_TYPES, strict=True):
        if name in fields:
            setattr(message, name, value_of(slot, fields[name]))
    return message


def value_of(slot: Any, value: Any) -> Any:
    if isinstance(slot, AbstractNestedType):
        inner = slot.value_type
        if isinstance(slot, Array) and isinstance(inner, BasicType) and inner.typename in DTYPES:
            return numpy.array(value, DTYPES[inner.typename])
        return [value_of(inner, item) for item in value]
    if isinstance(slot, NamespacedType):
        return message_of(class_of("/".join(slot.namespaced_name())), value)
    if isinstance(slot, BasicType) and slot.typename == "octet":
        return bytes([value])
    return value


def encode(type: str, fields: dict[str, Any]) -> str:
    return base64.b64encode(serialize_message(message_of(class_of(type), fields))).decode()


def decode(type: str, data: str) -> Any:
    return plain(deserialize_message(base64.b64decode(data), class_of(type)))


def describe(type: str) -> dict[str, Any]:
    """A type's constants, and the values that its fields have when nothing is said."""
    made = class_of(type)
    meta = made.__class__
    constants = vars(meta).get(f"_{meta.__name__}__constants", {})
    return {"constants": plain(constants), "defaults": plain(made())}


def hashes(types: list[str]) -> dict[str, str]:
    """The type hash of each message, as rcl's graph has it for a publisher."""
    rclpy.init()
    node = rclpy.create_node("codec")
    type_hashes = {}
    for number, type_name in enumerate(types):
        publisher = node.create_publisher(class_of(type_name), f"/t{number}", 1)
        (info,) = node.get_publishers_info_by_topic(f"/t{number}")
        type_hashes[type_name] = str(info.topic_type_hash)
        node.destroy_publisher(publisher)
    node.destroy_node()
    rclpy.shutdown()
    return type_hashes


COMMANDS = SimpleNamespace(encode=encode, decode=decode, describe=describe, hashes=hashes)

if __name__ == "__main__":
    obey(COMMANDS)

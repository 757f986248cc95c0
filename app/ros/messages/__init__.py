"""ROS 2 interfaces without ROS: definitions, checked values, CDR and type hashes.

`builtin/` has the definitions of each distribution. Further packages come from files and from the
robot's nodes.
"""

from app.ros.cdr.fields import FieldReader, Fields, RowReader, Rows, Walk
from app.ros.messages.definitions import (
    INTEGER_RANGES,
    PLACEHOLDER,
    STRING_TYPES,
    Field,
    Structure,
    Type,
)
from app.ros.messages.derived import ActionTypes
from app.ros.messages.distributions import DISTROS
from app.ros.messages.field_path import Absence, field_call, field_name, has_key, parent_path
from app.ros.messages.json_values import plain_text, to_plain
from app.ros.messages.registry import Interfaces, load_interfaces

__all__ = [
    "DISTROS",
    "INTEGER_RANGES",
    "PLACEHOLDER",
    "STRING_TYPES",
    "Absence",
    "ActionTypes",
    "Field",
    "FieldReader",
    "Fields",
    "Interfaces",
    "RowReader",
    "Rows",
    "Structure",
    "Type",
    "Walk",
    "field_call",
    "field_name",
    "has_key",
    "load_interfaces",
    "parent_path",
    "plain_text",
    "to_plain",
]

"""ROS 2 interfaces without ROS: definitions, checked values, CDR and type hashes.

`builtin/` has the definitions of each distribution. Further packages come from files and from the
robot's nodes.
"""

from app.interfaces.cdr.fields import FieldReader, Fields, RowReader, Rows, Walk
from app.interfaces.definitions import INTEGER_RANGES, PLACEHOLDER, STRING_TYPES, Field, Structure, Type
from app.interfaces.derived_types import ActionTypes
from app.interfaces.distributions import DISTROS
from app.interfaces.field_functions import Absence
from app.interfaces.field_path import field_call, field_name, has_key, parent_path
from app.interfaces.json_values import plain_text, to_plain
from app.interfaces.registry import Interfaces, load_interfaces

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

"""ROS 2 interfaces without ROS: definitions, checked values, CDR and type hashes.

The definitions of messages are rosbags' (`rosbags.typesys`); what it has not is here: services,
actions, packages from files, defaults, and the codec with checks that name the field.
"""

from app.interfaces.cdr.fields import FieldReader, Fields, Walk
from app.interfaces.definitions import INTEGERS, PLACEHOLDER, TEXTS, Field, Structure, Type
from app.interfaces.derived_types import ActionTypes
from app.interfaces.distributions import DISTROS, read_distribution
from app.interfaces.field_path import around, name_of
from app.interfaces.json_values import text_of, to_plain
from app.interfaces.registry import Interfaces, interfaces_of

__all__ = [
    "DISTROS",
    "INTEGERS",
    "PLACEHOLDER",
    "TEXTS",
    "ActionTypes",
    "Field",
    "FieldReader",
    "Fields",
    "Interfaces",
    "Structure",
    "Type",
    "Walk",
    "around",
    "interfaces_of",
    "name_of",
    "read_distribution",
    "text_of",
    "to_plain",
]

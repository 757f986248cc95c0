"""ROS 2 interfaces without ROS: definitions, checked values, CDR and type hashes.

The definitions of messages and the codec are rosbags' (`rosbags.typesys`, `rosbags.serde`); what
it has not is here: services, actions, packages from files, defaults, wstrings and checks that name
the field.
"""

from app.interfaces.composition import ActionTypes
from app.interfaces.definitions import INTEGERS, PLACEHOLDER, Field, Structure, Type
from app.interfaces.paths import value_at
from app.interfaces.plain import text_of, to_plain
from app.interfaces.store import DISTROS, Interfaces, interfaces_of

__all__ = [
    "DISTROS",
    "INTEGERS",
    "PLACEHOLDER",
    "ActionTypes",
    "Field",
    "Interfaces",
    "Structure",
    "Type",
    "interfaces_of",
    "text_of",
    "to_plain",
    "value_at",
]

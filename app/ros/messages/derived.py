"""What follows from an interface definition: the message types of services and actions, and type
hashes."""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from hashlib import sha256
from typing import Any, Final

from app.ros.messages.definitions import PLACEHOLDER, Definitions, Field, Structure, Type

# The message types that ROS 2 derives from a service and from an action.
#
# Source: rosidl (services and their events, since iron) and the design of actions (design.ros2.org,
# "actions"); the names are those of `ros2 interface` and of type descriptions.

UUID: Final = Type("unique_identifier_msgs/msg/UUID")
TIME: Final = Type("builtin_interfaces/msg/Time")
EVENT_INFO: Final = "service_msgs/msg/ServiceEventInfo"


@dataclass(frozen=True, slots=True)
class ActionTypes:
    """The names of the types of an action: message types, and three services."""

    goal: str
    result: str
    feedback: str
    send_goal: str  # a service
    send_goal_request: str  # goal_id, goal
    send_goal_response: str  # accepted, stamp
    get_result: str  # a service
    get_result_request: str  # goal_id
    get_result_response: str  # status (of action_msgs/msg/GoalStatus), result
    feedback_message: str  # goal_id, feedback
    cancel_goal: str = "action_msgs/srv/CancelGoal"  # a service
    status: str = "action_msgs/msg/GoalStatusArray"


def action_types(name: str) -> ActionTypes:
    """The names for an action "package/action/Name"."""
    return ActionTypes(
        goal=f"{name}_Goal",
        result=f"{name}_Result",
        feedback=f"{name}_Feedback",
        send_goal=f"{name}_SendGoal",
        send_goal_request=f"{name}_SendGoal_Request",
        send_goal_response=f"{name}_SendGoal_Response",
        get_result=f"{name}_GetResult",
        get_result_request=f"{name}_GetResult_Request",
        get_result_response=f"{name}_GetResult_Response",
        feedback_message=f"{name}_FeedbackMessage",
    )


def compose_service(name: str, request: Structure, response: Structure) -> Definitions:
    """A service "package/srv/Name" with its event (service introspection's)."""
    event = Structure(
        f"{name}_Event",
        (
            Field("info", Type(EVENT_INFO)),
            Field("request", Type(request.name, container="sequence", size=1)),
            Field("response", Type(response.name, container="sequence", size=1)),
        ),
        source=request.source,
    )
    whole = Structure(
        name,
        (
            Field("request_message", Type(request.name)),
            Field("response_message", Type(response.name)),
            Field("event_message", Type(event.name)),
        ),
        source=request.source,
    )
    return Definitions(
        {structure.name: structure for structure in (request, response, event)}, {name: whole}
    )


def compose_action(name: str, goal: Structure, result: Structure, feedback: Structure) -> Definitions:
    """An action "package/action/Name" with its two services and its feedback message."""
    types, source = action_types(name), goal.source
    goal_id = Field("goal_id", UUID)

    def structure(each: str, *fields: Field) -> Structure:
        return Structure(each, fields, source=source)

    send_goal = compose_service(
        types.send_goal,
        structure(types.send_goal_request, goal_id, Field("goal", Type(goal.name))),
        structure(types.send_goal_response, Field("accepted", Type("bool")), Field("stamp", TIME)),
    )
    status = Field("status", Type("int8"))
    get_result = compose_service(
        types.get_result,
        structure(types.get_result_request, goal_id),
        structure(types.get_result_response, status, Field("result", Type(result.name))),
    )
    message = structure(types.feedback_message, goal_id, Field("feedback", Type(feedback.name)))
    whole = structure(
        name,
        Field("goal", Type(goal.name)),
        Field("result", Type(result.name)),
        Field("feedback", Type(feedback.name)),
        Field("send_goal_service", Type(types.send_goal)),
        Field("get_result_service", Type(types.get_result)),
        Field("feedback_message", Type(types.feedback_message)),
    )
    own = {structure.name: structure for structure in (goal, result, feedback, message)}
    return send_goal | get_result | Definitions(own, {name: whole})


# Type hashes (REP 2016, version 1): the SHA-256 of a type description in JSON.

# Numbers of type_description_interfaces/msg/FieldType. `char` of a .msg file is uint8 there.
NESTED: Final = 1
BASE_IDS: Final[Mapping[str, int]] = {
    "int8": 2,
    "uint8": 3,
    "char": 3,
    "int16": 4,
    "uint16": 5,
    "int32": 6,
    "uint32": 7,
    "int64": 8,
    "uint64": 9,
    "float32": 10,
    "float64": 11,
    "bool": 15,
    "byte": 16,
    "octet": 16,
    "string": 17,
    "wstring": 18,
}
BOUNDED_TEXT: Final = 4  # added to the number of a string type; the next three to that of any type
ARRAY: Final = 48
BOUNDED_SEQUENCE: Final = 96
SEQUENCE: Final = 144


def type_hash(structure: Structure, find: Callable[[str], Structure]) -> str:
    """`RIHS01_` and 64 hexadecimal digits; `find` returns referenced structures by name."""
    inner = referenced_structures(structure, find)
    whole = {
        "type_description": _describe_structure(structure),
        "referenced_type_descriptions": [_describe_structure(inner[name]) for name in sorted(inner)],
    }
    return f"RIHS01_{sha256(json.dumps(whole).encode()).hexdigest()}"


def referenced_structures(
    structure: Structure, find: Callable[[str], Structure]
) -> dict[str, Structure]:
    """All structures that one references, directly or indirectly, by name; without itself."""
    inner: dict[str, Structure] = {}
    _collect(structure, find, inner)
    return inner


def _collect(
    structure: Structure, find: Callable[[str], Structure], inner: dict[str, Structure]
) -> None:
    for _, name in structure.nested_fields():
        if name not in inner:
            inner[name] = find(name)
            _collect(inner[name], find, inner)


def _describe_structure(structure: Structure) -> dict[str, Any]:
    fields = structure.fields or (Field(PLACEHOLDER, Type("uint8")),)
    return {"type_name": structure.name, "fields": [_describe_field(field) for field in fields]}


def _describe_field(field: Field) -> dict[str, Any]:
    described = {
        "type_id": _type_id(field.type),
        "capacity": field.type.size,
        "string_capacity": field.type.bound,
        "nested_type_name": field.type.name if field.type.is_nested else "",
    }
    return {"name": field.name, "type": described}


def _type_id(kind: Type) -> int:
    type_id = NESTED if kind.is_nested else BASE_IDS[kind.name] + (BOUNDED_TEXT if kind.bound else 0)
    match kind.container:
        case "one":
            return type_id
        case "array":
            return type_id + ARRAY
    return type_id + (BOUNDED_SEQUENCE if kind.size else SEQUENCE)

"""The parameters of the demo robot, as the services of a node give and take them: pure.

Shapes: rcl_interfaces' GetParameters, DescribeParameters, SetParameters and ParameterEvent.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

NODE: Final = "/system_controller"
EVENTS: Final = "/parameter_events"
EVENT_TYPE: Final = "rcl_interfaces/msg/ParameterEvent"
SERVICES: Final[Mapping[str, str]] = {
    f"{NODE}/get_parameters": "rcl_interfaces/srv/GetParameters",
    f"{NODE}/describe_parameters": "rcl_interfaces/srv/DescribeParameters",
    f"{NODE}/set_parameters": "rcl_interfaces/srv/SetParameters",
}

BOOL, INTEGER, DOUBLE, STRING = 1, 2, 3, 4
FIELDS: Final = {
    BOOL: "bool_value",
    INTEGER: "integer_value",
    DOUBLE: "double_value",
    STRING: "string_value",
}
EMPTY: Final[Mapping[str, Any]] = {
    "bool_value": False,
    "integer_value": 0,
    "double_value": 0.0,
    "string_value": "",
    "byte_array_value": (),
    "bool_array_value": (),
    "integer_array_value": (),
    "double_array_value": (),
    "string_array_value": (),
}

Fields = dict[str, Any]


@dataclass(slots=True)
class Parameter:
    """One parameter; `limits` are (lowest, highest, step) of a number."""

    type: int
    value: Any
    description: str
    limits: tuple[float, float, float] | None = None
    read_only: bool = False


class DemoParameters:
    """A node's parameters; `news` has an event for each change."""

    def __init__(self) -> None:
        self._declared = {
            "speed": Parameter(DOUBLE, 120.0, "of the feed", (0.0, 500.0, 10.0)),
            "parts": Parameter(INTEGER, 24, "in a batch", (1, 200, 1)),
            "work_light": Parameter(BOOL, False, "follows the door"),
            "batch": Parameter(STRING, "A-17", "printed on the label"),
            "serial": Parameter(STRING, "DEMO-0001", "from the factory", read_only=True),
        }
        self._news: list[Fields] = []

    def serve(self, service: str, request: Any) -> Fields:
        """The response of one of `SERVICES`; as rclcpp's, nothing where one name is not declared."""
        if service.endswith("/set_parameters"):
            return {"results": [self._set(one) for one in request.parameters]}
        known = all(name in self._declared for name in request.names)
        found = [(name, self._declared[name]) for name in request.names] if known else []
        if service.endswith("/get_parameters"):
            return {"values": [_value(one.type, one.value) for _, one in found]}
        return {"descriptors": [_descriptor(name, one) for name, one in found]}

    def news(self) -> list[Fields]:
        """The events since the last call; their stamps are left at 0."""
        news, self._news = self._news, []
        return news

    def _set(self, given: Any) -> Fields:
        reason = self._refusal(given)
        if not reason:
            declared = self._declared[given.name]
            declared.value = getattr(given.value, FIELDS[declared.type])
            changed = {"name": given.name, "value": _value(declared.type, declared.value)}
            self._news.append(_event([changed]))
        return {"successful": not reason, "reason": reason}

    def _refusal(self, given: Any) -> str:
        """Why a value is not taken; "" if it is."""
        declared = self._declared.get(given.name)
        if declared is None:
            return f"parameter '{given.name}' is not declared"
        if declared.read_only:
            return f"parameter '{given.name}' is read-only"
        if given.value.type != declared.type:
            return f"parameter '{given.name}' has another type"
        value = getattr(given.value, FIELDS[declared.type])
        if given.name == "batch" and not value.strip():
            return "a batch needs a name"
        if declared.limits is None:
            return ""
        low, high, step = declared.limits
        fits = low <= value <= high and (value - low) % step == 0
        return "" if fits else f"parameter '{given.name}' is out of its range"


def _value(kind: int, value: Any) -> Fields:
    return {**EMPTY, "type": kind, FIELDS[kind]: value}


def _descriptor(name: str, parameter: Parameter) -> Fields:
    ranges: list[Fields] = []
    if parameter.limits is not None:
        low, high, step = parameter.limits
        ranges = [{"from_value": low, "to_value": high, "step": step}]
    return {
        "name": name,
        "type": parameter.type,
        "description": parameter.description,
        "additional_constraints": "",
        "read_only": parameter.read_only,
        "floating_point_range": ranges if parameter.type == DOUBLE else [],
        "integer_range": ranges if parameter.type == INTEGER else [],
    }


def _event(changed: Sequence[Fields]) -> Fields:
    return {
        "stamp": {"sec": 0, "nanosec": 0},
        "node": NODE,
        "new_parameters": [],
        "changed_parameters": list(changed),
        "deleted_parameters": [],
    }

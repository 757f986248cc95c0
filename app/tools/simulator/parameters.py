"""The parameters of simulated nodes, as the services of a node give and take them: pure.

Shapes: rcl_interfaces' ListParameters, GetParameters, DescribeParameters, SetParameters,
SetParametersAtomically and ParameterEvent.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from app.panel.numbers import Range
from app.panel.values import same_value

NODE: Final = "/system_controller"  # of the robot that the shipped panel is for
EVENTS: Final = "/parameter_events"
EVENT_TYPE: Final = "rcl_interfaces/msg/ParameterEvent"
SERVICES: Final[Mapping[str, str]] = {
    "list_parameters": "rcl_interfaces/srv/ListParameters",
    "get_parameters": "rcl_interfaces/srv/GetParameters",
    "describe_parameters": "rcl_interfaces/srv/DescribeParameters",
    "set_parameters": "rcl_interfaces/srv/SetParameters",
    "set_parameters_atomically": "rcl_interfaces/srv/SetParametersAtomically",
}

BOOL, INTEGER, DOUBLE, STRING = 1, 2, 3, 4
INTEGERS, DOUBLES = 7, 8
FIELDS: Final = {
    BOOL: "bool_value",
    INTEGER: "integer_value",
    DOUBLE: "double_value",
    STRING: "string_value",
    6: "bool_array_value",
    INTEGERS: "integer_array_value",
    DOUBLES: "double_array_value",
    9: "string_array_value",
}
FIRST_ARRAY: Final = 6
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
INT64: Final = (-(2**63), 2**63 - 1)

Fields = dict[str, Any]


@dataclass(slots=True)
class Parameter:
    """One parameter; `limits` are those of a number, or of each in a list. `options` are the only
    values that it takes, if there are any."""

    type: int
    value: Any
    description: str = ""
    limits: Range | None = None
    read_only: bool = False
    options: tuple[Any, ...] = ()
    empty: str = ""  # why a text without a character is not taken; "" where it is


class NodeParameters:
    """A node's parameters; `news` has an event for each change."""

    def __init__(self, node: str, declared: Mapping[str, Parameter]) -> None:
        self._node = node
        self._declared = dict(declared)
        self._news: list[Fields] = []

    def serve(self, service: str, request: Any) -> Fields:
        """The response of one of `SERVICES`; as rclcpp's, nothing where one name is not declared."""
        if service.endswith("/set_parameters"):
            return {"results": [self._set(parameter) for parameter in request.parameters]}
        if service.endswith("/set_parameters_atomically"):
            reasons = filter(None, map(self._refusal, request.parameters))
            if reason := next(reasons, ""):
                return {"result": {"successful": False, "reason": reason}}
            return {"result": [self._set(parameter) for parameter in request.parameters][-1]}
        if service.endswith("/list_parameters"):
            return {"result": {"names": sorted(self._declared), "prefixes": []}}
        known = all(name in self._declared for name in request.names)
        parameters = [(name, self._declared[name]) for name in request.names] if known else []
        if service.endswith("/get_parameters"):
            return {"values": [_value(parameter.type, parameter.value) for _, parameter in parameters]}
        return {"descriptors": [_descriptor(name, parameter) for name, parameter in parameters]}

    def value(self, name: str, default: Any) -> Any:
        """The value of a parameter, or a default if it is not declared."""
        return self._declared[name].value if name in self._declared else default

    def news(self) -> list[Fields]:
        """The events since the last call; their stamps are left at 0."""
        news, self._news = self._news, []
        return news

    def show(self, name: str, value: Any) -> None:
        """A declared parameter has this value from now on."""
        if (declared := self._declared.get(name)) is not None:
            declared.value = value
            changed = {"name": name, "value": _value(declared.type, value)}
            self._news.append(_event(self._node, [changed]))

    def _set(self, parameter: Any) -> Fields:
        reason = self._refusal(parameter)
        if not reason:
            declared = self._declared[parameter.name]
            self.show(parameter.name, _plain(getattr(parameter.value, FIELDS[declared.type])))
        return {"successful": not reason, "reason": reason}

    def _refusal(self, parameter: Any) -> str:
        """Why a value is not taken; "" if it is."""
        declared = self._declared.get(parameter.name)
        if declared is None:
            return f"parameter '{parameter.name}' is not declared"
        if declared.read_only:
            return f"parameter '{parameter.name}' is read-only"
        if parameter.value.type != declared.type:
            return f"parameter '{parameter.name}' has another type"
        value = _plain(getattr(parameter.value, FIELDS[declared.type]))
        if declared.empty and not value.strip():
            return declared.empty
        if declared.options and not any(same_value(value, option) for option in declared.options):
            return f"parameter '{parameter.name}' has no such option"
        several = value if declared.type >= FIRST_ARRAY else [value]
        if declared.limits is None or all(declared.limits.contains(number) for number in several):
            return ""
        return f"parameter '{parameter.name}' is out of its range"


def _plain(value: Any) -> Any:
    """A value of a message; a list of any kind as a list."""
    return value if isinstance(value, bool | int | float | str) else list(value)


def _value(kind: int, value: Any) -> Fields:
    return {**EMPTY, "type": kind, FIELDS[kind]: value}


def _descriptor(name: str, parameter: Parameter) -> Fields:
    return {
        "name": name,
        "type": parameter.type,
        "description": parameter.description,
        "additional_constraints": "",
        "read_only": parameter.read_only,
        "floating_point_range": _described(parameter, (DOUBLE, DOUBLES), (-math.inf, math.inf)),
        "integer_range": _described(parameter, (INTEGER, INTEGERS), INT64),
    }


def _described(parameter: Parameter, kinds: tuple[int, ...], ends: tuple[float, float]) -> list[Fields]:
    limits = parameter.limits
    if limits is None or parameter.type not in kinds:
        return []
    low, high = (
        ends[0] if limits.low is None else limits.low,
        (ends[1] if limits.high is None else limits.high),
    )
    return [{"from_value": low, "to_value": high, "step": limits.step or 0}]


def _event(node: str, changed: Sequence[Fields]) -> Fields:
    return {
        "stamp": {"sec": 0, "nanosec": 0},
        "node": node,
        "new_parameters": [],
        "changed_parameters": list(changed),
        "deleted_parameters": [],
    }

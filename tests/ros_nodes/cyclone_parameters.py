"""The parameters of the robot's node: their values, ranges, refusals, services and events."""

import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

from cyclone_node import Answer, Node, qos_of
from cyclone_types import (
    DescribeParameters_Request,
    DescribeParameters_Response,
    FloatingPointRange,
    GetParameters_Request,
    GetParameters_Response,
    GetParameterTypes_Request,
    GetParameterTypes_Response,
    IntegerRange,
    ListParameters_Request,
    ListParameters_Response,
    ListParametersResult,
    Parameter,
    ParameterDescriptor,
    ParameterEvent,
    ParameterValue,
    SetParameters_Request,
    SetParameters_Response,
    SetParametersAtomically_Request,
    SetParametersAtomically_Response,
    SetParametersResult,
    Time,
)

NAMES = ("not set", "bool", "integer", "double", "string", "bytes", "bools", "integers", "doubles",
         "strings")  # fmt: skip
FIELDS = ("", "bool_value", "integer_value", "double_value", "string_value", "byte_array_value",
          "bool_array_value", "integer_array_value", "double_array_value",
          "string_array_value")  # fmt: skip
_, BOOL, INTEGER, DOUBLE, STRING = range(5)
KINDS = {bool: BOOL, int: INTEGER, float: DOUBLE, str: STRING}
LISTS = 5  # a list's type is so many after that of its elements


def kind_of(value: Any) -> int:
    return KINDS[type(value[0])] + LISTS if isinstance(value, list) else KINDS[type(value)]


def _value_of(parameter: Parameter) -> Any:
    type_ = parameter.value.type
    return getattr(parameter.value, FIELDS[type_]) if 0 < type_ < len(FIELDS) else None


EVENT_HASH = "RIHS01_043e627780fcad87a22d225bc2a037361dba713fca6a6b9f4b869a5aa0393204"


@dataclass
class Declared:
    descriptor: ParameterDescriptor
    value: Any

    @property
    def wire(self) -> ParameterValue:
        return ParameterValue(type=self.descriptor.type, **{FIELDS[self.descriptor.type]: self.value})

    @property
    def parameter(self) -> Parameter:
        return Parameter(self.descriptor.name, self.wire)

    def refusal(self, type_: int, value: Any) -> str:
        """Why a value is not taken; empty if it is."""
        d = self.descriptor
        if d.read_only:
            return f"parameter '{d.name}' is read-only"
        if type_ != d.type:
            other_type = NAMES[type_] if type_ < len(NAMES) else "array"
            return f"parameter '{d.name}' is of type {NAMES[d.type]}, not {other_type}"
        each = value if isinstance(value, list) else [value]
        return next(filter(None, map(self._off_limits, each)), "")

    def _off_limits(self, value: Any) -> str:
        d = self.descriptor
        for limits in (*d.floating_point_range, *d.integer_range):
            if not limits.from_value <= value <= limits.to_value:
                return f"parameter '{d.name}' is out of range {limits.from_value} to {limits.to_value}"
            steps = (value - limits.from_value) / limits.step if limits.step else 0
            if value != limits.to_value and abs(steps - round(steps)) > 1e-6:
                return f"parameter '{d.name}' is not on a step of {limits.step}"
        return ""


def robot_parameters() -> list[Declared]:
    describe = ParameterDescriptor
    speed = describe("speed", DOUBLE, "m/s", floating_point_range=[FloatingPointRange(0.0, 2.0, 0.1)])
    gain = FloatingPointRange(0.0, 5.0, 0.0)
    limit = describe("limit", INTEGER, "kg", integer_range=[IntegerRange(0, 100, 0)])
    return [
        Declared(speed, 0.5),
        Declared(describe("name", STRING), "cyclone"),
        Declared(describe("enabled", BOOL), True),
        Declared(limit, 10),
        Declared(describe("serial", STRING, "from the factory", read_only=True), "CR-0001"),
        Declared(describe("gains", DOUBLE + LISTS, floating_point_range=[gain]), [1.0, 2.5]),
        Declared(describe("axes", BOOL + LISTS), [True, False]),
        Declared(describe("frames", STRING + LISTS), ["base", "tool, left"]),
        Declared(describe("slots", INTEGER + LISTS), [1, 2**53 + 1]),
        Declared(describe("mode", INTEGER), 1),
    ]


class Parameters:
    def __init__(self, node: Node) -> None:
        self._node_name = f"/{node.name}"
        self._declared = {p.descriptor.name: p for p in robot_parameters()}
        self._silent: dict[str, float | None] = {}
        self._requests: list[str] = []
        self.refusal = ""  # why every set is refused
        self.odd: dict[str, Any] = {}  # values by name that are refused, whatever is described
        self._events = node.advertise(
            "/parameter_events", ParameterEvent, qos_of(1000, user_data=f"typehash={EVENT_HASH};")
        )
        for service, request, response, handler in (
            ("get_parameters", GetParameters_Request, GetParameters_Response, self._get),
            ("get_parameter_types", GetParameterTypes_Request, GetParameterTypes_Response, self._types),
            ("set_parameters", SetParameters_Request, SetParameters_Response, self._set),
            (
                "set_parameters_atomically",
                SetParametersAtomically_Request,
                SetParametersAtomically_Response,
                self._set_atomically,
            ),
            ("list_parameters", ListParameters_Request, ListParameters_Response, self._list),
            (
                "describe_parameters",
                DescribeParameters_Request,
                DescribeParameters_Response,
                self._describe,
            ),
        ):
            node.serve(
                f"{self._node_name}/{service}", request, response, self._served(service, handler)
            )

    def _served(self, service: str, handler: Callable[..., None]) -> Callable[..., None]:
        def serve(request: Any, answer: Answer) -> None:
            self._requests.append(service)
            delay = self._silent.get(service, 0.0)
            if delay == 0.0:
                handler(request, answer)
            elif delay is not None:
                later = threading.Timer(delay, handler, [request, answer])
                later.daemon = True
                later.start()

        return serve

    def requests(self, service: str) -> int:
        """How often a service was asked."""
        return self._requests.count(service)

    def answer(self, service: str, seconds: float | None) -> None:
        """After how many seconds a service does what it is asked and answers; None: never."""
        self._silent[service] = seconds

    def declare(self, name: str, value: Any, **more: Any) -> None:
        """Declares a parameter, or declares it again, and publishes the change."""
        type_ = kind_of(value)
        if whole := more.pop("whole_range", None):  # from, to, step
            more["integer_range"] = [IntegerRange(*whole)]
        self._declared[name] = Declared(ParameterDescriptor(name, type_, **more), value)
        self._tell([], new=[self._declared[name]])

    def undeclare(self, name: str) -> None:
        self._tell([], deleted=[self._declared.pop(name)])

    def take_all(self, values: dict[str, Any]) -> None:
        """Each change with an event of its own, as fast as it goes."""
        for name, value in values.items():
            self.take(name, value)

    def values(self) -> dict[str, Any]:
        return {name: p.value for name, p in self._declared.items()}

    def take(self, name: str, value: Any) -> None:
        """The robot itself changes a parameter, whatever its descriptor says; publishes it."""
        self._declared[name].value = value
        self._tell([self._declared[name]])

    def _get(self, request: GetParameters_Request, answer: Answer) -> None:
        answer(GetParameters_Response([p.wire for p in self._named(request.names)]))

    def _types(self, request: GetParameterTypes_Request, answer: Answer) -> None:
        answer(GetParameterTypes_Response([p.descriptor.type for p in self._named(request.names)]))

    def _describe(self, request: DescribeParameters_Request, answer: Answer) -> None:
        descriptors = [replace(p.descriptor) for p in self._named(request.names)]
        answer(DescribeParameters_Response(descriptors))

    def _list(self, request: ListParameters_Request, answer: Answer) -> None:
        """None of the names has a prefix, so the client that asks for one gets nothing."""
        names = [n for n in self._declared if not request.prefixes or n in request.prefixes]
        answer(ListParameters_Response(ListParametersResult(names, [])))

    def _set(self, request: SetParameters_Request, answer: Answer) -> None:
        results = []
        for parameter in request.parameters:
            reason = self._set_one(parameter)
            results.append(SetParametersResult(not reason, reason))
        answer(SetParameters_Response(results))

    def _set_atomically(self, request: SetParametersAtomically_Request, answer: Answer) -> None:
        reason = next(filter(None, map(self._refusal, request.parameters)), "")
        if not reason:
            for parameter in request.parameters:
                self._set_one(parameter)
        answer(SetParametersAtomically_Response(SetParametersResult(not reason, reason)))

    def _set_one(self, parameter: Parameter) -> str:
        reason = self._refusal(parameter)
        if not reason:
            declared = self._declared[parameter.name]
            declared.value = _value_of(parameter)
            self._tell([declared])
        return reason

    def _refusal(self, parameter: Parameter) -> str:
        declared = self._declared.get(parameter.name)
        if declared is None:
            return f"parameter '{parameter.name}' was not declared"
        value = _value_of(parameter)
        if parameter.name in self.odd and self.odd[parameter.name] == value:
            return f"parameter '{parameter.name}' can't be {value} now"
        return self.refusal or declared.refusal(parameter.value.type, value)

    def _named(self, names: list[str]) -> list[Declared]:
        """As in rclcpp: one undeclared name, and there is no answer for any of them."""
        if not all(name in self._declared for name in names):
            return []
        return [self._declared[name] for name in names]

    def _tell(
        self, changed: list[Declared], new: Sequence[Declared] = (), deleted: Sequence[Declared] = ()
    ) -> None:
        stamp = Time.at(time.time_ns())
        names = [[p.parameter for p in some] for some in (new, changed, deleted)]
        self._events.write(ParameterEvent(stamp, self._node_name, *names))

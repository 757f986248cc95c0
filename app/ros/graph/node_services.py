"""Reads parameters and type descriptions from the services of nodes.

A node is called only if its service can be called (`Server.can_be_called`). On another DDS than the
bridge's a request is misread, and a request without a response stays in the bridge forever.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any, Final, Protocol

from app.ros.graph.model import Node, RobotGraph, SurveyedTopic
from app.ros.messages import Interfaces
from app.ros.messages.definitions import Definitions
from app.ros.messages.type_descriptions import SERVICE, SERVICE_TYPE_NAME, definitions_of
from app.system.errors import DecodeError, InterfaceError

# The names of rcl_interfaces/msg/ParameterType, by their numbers.
PARAMETER_TYPES: Final = (
    "not set", "bool", "integer", "double", "string", "byte[]", "bool[]", "integer[]", "double[]",
    "string[]",
)  # fmt: skip
_FIELDS: Final[Mapping[str, str]] = {
    name: f"{name.removesuffix('[]')}{'_array' if name.endswith('[]') else ''}_value"
    for name in PARAMETER_TYPES[1:]
}
LIST: Final = ("list_parameters", "rcl_interfaces/srv/ListParameters")
DESCRIBE: Final = ("describe_parameters", "rcl_interfaces/srv/DescribeParameters")
GET: Final = ("get_parameters", "rcl_interfaces/srv/GetParameters")


@dataclass(frozen=True, slots=True, kw_only=True)
class NodeParameter:
    """A parameter of a node. `type` is of `PARAMETER_TYPES`. `min`, `max` and `step` are None where the
    node gives none. `value` is a bool, int, float, str or a list of them; None if not set."""

    node: str
    name: str
    type: str
    value: Any = None
    description: str = ""
    read_only: bool = False
    min: float | None = None
    max: float | None = None
    step: float | None = None


class ServiceClient(Protocol):
    """The part of a link that service calls need."""

    async def call(self, key: str, payload: bytes, timeout_s: float = ...) -> bytes | None:
        """The response of a service; None without one in time."""


class NodeServices:
    """Calls the services of one robot's nodes."""

    def __init__(self, robot: RobotGraph, interfaces: Interfaces, client: ServiceClient) -> None:
        self._robot = robot
        self._interfaces = interfaces
        self._client = client
        self._silent: set[str] = set()  # nodes that are not called again

    def has_parameters(self, node: Node) -> bool:
        """Whether its parameters can be read through the bridge."""
        return all(self._can_call(node.name, name, kind) for name, kind in (LIST, DESCRIBE, GET))

    async def parameters(self, node: Node) -> tuple[NodeParameter, ...] | None:
        """The node's parameters, sorted by name; None if they can't be read."""
        if not self.has_parameters(node):
            return None
        listed = await self._call(node.name, LIST, {"prefixes": [], "depth": 0})
        if listed is None:
            return None
        names = sorted(listed.result.names)
        described = await self._call(node.name, DESCRIBE, {"names": names}) if names else None
        values = await self._call(node.name, GET, {"names": names}) if described is not None else None
        if values is None or described is None:
            return None if names else ()
        pairs = zip(described.descriptors, values.values, strict=False)
        return tuple(_parameter(node.name, descriptor, value) for descriptor, value in pairs)

    async def definitions(self, topic: SurveyedTopic) -> Definitions | None:
        """The topic's type as one of its publishers or subscribers describes it; None if none does.
        InterfaceError for a description that can't be used."""
        for endpoint in (*topic.publishers, *topic.subscribers):
            if not endpoint.type_hash:
                continue
            request = {"type_name": endpoint.type, "type_hash": endpoint.type_hash}
            for node in endpoint.nodes:
                if not self._can_call(node, SERVICE, SERVICE_TYPE_NAME):
                    continue
                fields = {**request, "include_type_sources": False}
                answer = await self._call(node, (SERVICE, SERVICE_TYPE_NAME), fields)
                if answer is not None and answer.successful:
                    return definitions_of(answer.type_description, endpoint.type_hash)
        return None

    def _can_call(self, node: str, service: str, type_name: str) -> bool:
        server = self._robot.service(f"{node}/{service}")
        known = server is not None and server.type == type_name and server.can_be_called
        return known and node not in self._silent

    async def _call(self, node: str, service: tuple[str, str], fields: Mapping[str, Any]) -> Any:
        """The response; None for none, and then the node is not called again."""
        try:
            request, response = self._interfaces.service_types(service[1])
            payload = self._interfaces.encode(request, fields)
            key = self._robot.key(f"{node}/{service[0]}")
            answer = await self._client.call(key, payload)
            if answer is not None:
                return self._interfaces.decode_whole(response, answer)
        except (DecodeError, InterfaceError):
            pass
        self._silent.add(node)
        return None


def _parameter(node: str, descriptor: Any, value: Any) -> NodeParameter:
    number = value.type or descriptor.type
    kind = PARAMETER_TYPES[number] if number < len(PARAMETER_TYPES) else PARAMETER_TYPES[0]
    ranges: Sequence[Any] = (
        descriptor.integer_range if kind.startswith("integer") else descriptor.floating_point_range
    )
    limits = ranges[0] if ranges else None
    return NodeParameter(
        node=node,
        name=descriptor.name,
        type=kind,
        value=_value(value, kind) if value.type else None,
        description=" ".join(filter(None, (descriptor.description, descriptor.additional_constraints))),
        read_only=bool(descriptor.read_only),
        min=None if limits is None else _finite(limits.from_value),
        max=None if limits is None else _finite(limits.to_value),
        step=None if limits is None else _finite(limits.step) or None,
    )


def _value(value: Any, kind: str) -> Any:
    field = getattr(value, _FIELDS[kind])
    return list(field) if kind.endswith("[]") else field


def _finite(number: float) -> float | None:
    return number if isfinite(number) else None

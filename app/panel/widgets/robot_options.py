"""Where the options of a select come from, if the robot has them: a list of texts on a topic, in a
service's answer, or in a parameter; or the numbers that a parameter may have."""

import json
from collections.abc import Iterator
from typing import Annotated, Any, Final, NamedTuple

from pydantic import AfterValidator, Field, TypeAdapter

from app.panel.base import (
    MessageField,
    MessageOrServiceType,
    NodeName,
    ParameterName,
    Seconds,
    TopicName,
    TopicQos,
)
from app.panel.checks.types import field_faults, type_fault, way_faults
from app.panel.shared_keys import AgeKey
from app.panel.template import placeholders
from app.panel.widgets.families import TopicSource
from app.ros.dialects.dialect import Role
from app.ros.messages import STRING_TYPES, Interfaces
from app.system.errors import Fault, FieldError, InterfaceError

EACH: Final = "[]."  # before the field of each message of a list
OF_SERVICES_ONLY: Final = "is a field of a list of messages, which is read of a service's answer only"
MOST: Final = 200  # options that are shown; a press with a later one is refused
KEY: Final = "options_from"
PARAMETER_SERVICES: Final = ("get_parameters", "describe_parameters", "set_parameters")
SOURCES: Final = ("topic", "service", "parameter")
LATE_S: Final = 10.0  # a list of a service is known for so long after its next answer was due
OF_PARAMETERS: Final = "is for topic or service: a node says itself when a parameter changes"
OF_NODES: Final = "is for node and parameter: their range is a parameter's constraint"
OF_SERVICES: Final = "is for service: it is what the service is asked with"
NO_INPUTS: Final = "stands for an input: a list is asked for without the page. Write a value"
NO_SOURCE: Final = (
    'names no list: write topic or service with their type, as in { topic = "/stations", type = '
    '"cell_msgs/msg/Names" }, or node and parameter'
)


def _check_listed_field(path: str) -> str:
    """`programs[].name`: a field of each message of a list."""
    field = LISTED.validate_python
    for part in path.split(EACH, 1):
        field(part)
    return path


LISTED: Final = TypeAdapter(MessageField)
ListedField = Annotated[str, AfterValidator(_check_listed_field)]


class ListedParameter(NamedTuple):
    """A parameter whose texts are the options; with `of_range` the whole numbers of its range are."""

    node: str
    name: str
    of_range: bool = False


class ListingService(NamedTuple):
    """A service that is called again and again with this request (JSON): the `field` of its answer has
    the texts."""

    name: str
    type: str
    field: str
    request: str = "{}"


class RobotOptions(AgeKey):
    """A list of texts of the robot: a field of a topic or of a service's answer, or a parameter; with
    `range` the whole numbers that the parameter's integer range allows.

    Older than `max_age_s` it is not known. A service is called every `every_s`, with `request`.
    """

    topic: TopicName | None = None
    service: TopicName | None = None
    node: NodeName | None = None
    parameter: ParameterName | None = None
    range: bool = False
    request: dict[str, Any] = Field(default_factory=dict)
    type: MessageOrServiceType | None = None
    field: ListedField = "data"
    every_s: Annotated[Seconds, Field(ge=1.0)] = 10.0
    qos: TopicQos = TopicQos()

    @property
    def source(self) -> TopicSource | None:
        """Its topic, None without."""
        if self.topic is None or self.type is None:
            return None
        return TopicSource(self.topic, self.type, self.qos, (self.field,), KEY)

    @property
    def listing(self) -> ListingService | None:
        """Its service, None without."""
        if self.service is None or self.type is None:
            return None
        request = json.dumps(self.request, sort_keys=True)
        return ListingService(self.service, self.type, self.field, request)

    @property
    def listed(self) -> ListedParameter | None:
        """Its parameter, None without."""
        if self.node is None or self.parameter is None:
            return None
        return ListedParameter(self.node, self.parameter, self.range)

    @property
    def limit_s(self) -> float | None:
        """How old a list may be, in seconds; None: of any age."""
        if self.max_age_s is not None or self.service is None:
            return self.max_age_s
        return self.every_s + LATE_S

    @property
    def list_name(self) -> str:
        """The name of what has the list."""
        return self.topic or self.service or f"{self.parameter} of {self.node}"

    def endpoints(self) -> Iterator[tuple[Role, str]]:
        """The server that the robot must have, as (role, ROS name)."""
        if self.service is not None:
            yield "SS", self.service
        if self.node is not None:
            yield from (("SS", f"{self.node}/{service}") for service in PARAMETER_SERVICES)

    def faults(self, place: str, interfaces: Interfaces) -> Iterator[Fault]:
        """Faults of keys that do not belong together, and of a field that is no list of texts."""
        named = [key for key in SOURCES if getattr(self, key) is not None]
        if not named and self.node is None:
            yield Fault(place, NO_SOURCE)
        elif len(named) > 1:
            yield Fault(f"{place}.{named[1]}", f"stands beside {named[0]}: write the one or the other")
        elif self.node is not None or self.parameter is not None:
            yield from self._parameter_faults(place)
        else:
            yield from self._type_faults(place, interfaces)

    def _parameter_faults(self, place: str) -> Iterator[Fault]:
        for key, other in (("node", "parameter"), ("parameter", "node")):
            if getattr(self, key) is None:
                yield Fault(f"{place}.{key}", f"is missing beside {other}")
        for key in ("type", "field", "every_s", "max_age_s", "qos", "request"):
            if key in self.model_fields_set:
                yield Fault(f"{place}.{key}", OF_PARAMETERS)

    def _type_faults(self, place: str, interfaces: Interfaces) -> Iterator[Fault]:
        kind = "service" if self.service is not None else "topic"
        if self.type is None:
            yield Fault(f"{place}.type", f"is missing beside {kind}")
            return
        if faults := list(way_faults(place, self.type, of_service=kind == "service")):
            yield from faults
            return
        for key in ("qos",) if kind == "service" else ("every_s", "request"):
            if key in self.model_fields_set:
                why = OF_SERVICES if key == "request" else f"is for a {_OTHER[kind]}"
                yield Fault(f"{place}.{key}", why)
        if "range" in self.model_fields_set:
            yield Fault(f"{place}.range", OF_NODES)
        yield from self._field_faults(place, self.type, interfaces)

    def _field_faults(self, place: str, type_name: str, interfaces: Interfaces) -> Iterator[Fault]:
        if self.service is not None:
            try:
                request, type_name = interfaces.service_types(type_name)
            except InterfaceError as error:
                yield type_fault(f"{place}.type", error)
                return
            yield from self._request_faults(f"{place}.request", request, interfaces)
        if EACH in self.field:
            yield from self._each_faults(place, type_name, interfaces)
            return
        faults = list(field_faults(place, type_name, self.field, interfaces))
        yield from faults
        field_type = None if faults else interfaces.type_at(type_name, self.field)
        if field_type is not None and (
            field_type.container == "one" or field_type.name not in STRING_TYPES
        ):
            message = f'"{self.field}" is {field_type}: options are a list of texts, like string[]'
            yield Fault(f"{place}.field", message)

    def _each_faults(self, place: str, type_name: str, interfaces: Interfaces) -> Iterator[Fault]:
        """Faults of a text of each message of a list."""
        path, item = self.field.split(EACH, 1)
        if self.service is None:
            yield Fault(f"{place}.field", f'"{self.field}" {OF_SERVICES_ONLY}')
            return
        faults = list(field_faults(place, type_name, path, interfaces))
        yield from faults
        if faults:
            return
        kind = interfaces.type_at(type_name, path)
        if kind.container == "one" or not kind.is_nested:
            yield Fault(f"{place}.field", f'"{path}" is {kind}: before [] stands a list of messages')
            return
        faults = list(field_faults(place, kind.name, item, interfaces))
        yield from faults
        text = None if faults else interfaces.type_at(kind.name, item)
        if text is not None and (text.container != "one" or text.name not in STRING_TYPES):
            yield Fault(f"{place}.field", f'"{self.field}" is {text}: options are texts, like string')

    def _request_faults(self, place: str, type_name: str, interfaces: Interfaces) -> Iterator[Fault]:
        try:
            for where, name in placeholders(self.request):
                yield Fault(f"{place}.{where}", f'"{{{name}}}" {NO_INPUTS}')
                return
            interfaces.encode(type_name, self.request)
        except FieldError as error:
            yield Fault(f"{place}.{error.field}".rstrip("."), error.message)


_OTHER: Final = {"service": "topic", "topic": "service"}

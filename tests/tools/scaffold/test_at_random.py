"""A panel made of any graph, with any values on its topics, is a good one."""

import string
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Final

from hypothesis import given
from hypothesis import strategies as some

from app.panel.file.load import faults_of_text
from app.ros.graph.model import EndpointQos, Server, SurveyedTopic, TopicEndpoint
from app.ros.graph.node_services import PARAMETER_TYPES, NodeParameter
from app.ros.messages import Type, load_interfaces
from app.ros.messages.definitions import INTEGER_RANGES, attribute_name
from app.ros.messages.names import is_valid_name
from app.tools.scaffold.checked import checked_draft
from app.tools.scaffold.draft import Known, make_draft
from app.tools.scaffold.parts import Draft
from app.tools.scaffold.toml_text import toml_text

INTERFACES: Final = load_interfaces("jazzy")
MESSAGES: Final = sorted(name for name in INTERFACES.structures if "/msg/" in name)
SERVICES: Final = sorted(
    name.removesuffix("_Request") for name in INTERFACES.structures if name.endswith("_Request")
    if "/srv/" in name
)  # fmt: skip
ACTIONS: Final = sorted(
    name.removesuffix("_Goal") for name in INTERFACES.structures if name.endswith("_Goal")
)
EXTREMES: Final = (1.7e308, -1.7e308, 5e-324, -5e-324, 2.0**53 + 2, 1e300, float("nan"), float("inf"))
DEEPEST: Final = 3

texts = some.one_of(
    some.text(max_size=20),
    some.sampled_from(["a\x07b", "x" * 200_000, 'a"\n[[page]]\n', "\ud800", "", "\x7f\x85\u2028"]),
)
parts = some.one_of(
    some.sampled_from(["arm", "left", "right", "home", "enabled", "estop", "tf", "a__b", "x" * 301]),
    some.text(string.ascii_letters + string.digits + "_", min_size=1, max_size=12),
)
names = some.lists(parts, min_size=1, max_size=4).map("/".join).filter(is_valid_name).map("/{}".format)
numbers = some.one_of(some.sampled_from(EXTREMES), some.floats())


def scalars(kind: str) -> some.SearchStrategy[Any]:
    if kind == "bool":
        return some.booleans()
    if kind in INTEGER_RANGES:
        low, high = INTEGER_RANGES[kind]
        return some.one_of(some.integers(low, high), some.sampled_from([low, high]))
    return numbers if kind.startswith("float") else texts


def message(draw: Callable[..., Any], type_name: str, depth: int = 0) -> SimpleNamespace:
    """A message as it is decoded."""

    def element(kind: Type) -> Any:
        if not kind.is_nested:
            return draw(scalars(kind.name))
        return message(draw, kind.name, depth + 1) if depth < DEEPEST else None

    def value(kind: Type) -> Any:
        if kind.container == "one":
            return element(kind)
        return [element(kind) for _ in range(draw(some.integers(0, 3)))]

    fields = INTERFACES.structures[type_name].fields
    return SimpleNamespace(**{attribute_name(field.name): value(field.type) for field in fields})


@some.composite
def endpoints(draw: Callable[..., Any], type_name: str) -> TopicEndpoint:
    qos = EndpointQos(
        reliable=draw(some.sampled_from([True, False, None])), transient_local=draw(some.booleans())
    )
    return TopicEndpoint(type=type_name, qos=qos, bridge="a", nodes=(draw(names),))


@some.composite
def topics(draw: Callable[..., Any]) -> SurveyedTopic:
    name, type_name = draw(names), draw(some.sampled_from(MESSAGES))
    ends = draw(some.lists(endpoints(type_name), min_size=1, max_size=2))
    listens = draw(some.booleans())
    return SurveyedTopic(
        name=name,
        key=name[1:],
        publishers=() if listens else tuple(ends),
        subscribers=tuple(ends) if listens else (),
        announced=draw(some.sampled_from([True, True, True, False])),
    )


@some.composite
def servers(draw: Callable[..., Any], types: Sequence[str]) -> Server:
    name = draw(names)
    kind = draw(some.sampled_from(types))
    return Server(name=name, key=name[1:], type=kind, bridge="a", nodes=(draw(names),))


@some.composite
def parameters(draw: Callable[..., Any]) -> NodeParameter:
    return NodeParameter(
        node=draw(names),
        name=draw(some.one_of(texts, some.just("x" * 300), some.just("now"))),
        type=draw(some.sampled_from(PARAMETER_TYPES)),
        value=draw(some.one_of(some.none(), texts, numbers, some.lists(numbers, max_size=3))),
        description=draw(texts),
    )


@some.composite
def robots(draw: Callable[..., Any]) -> Known:
    drawn = draw(some.lists(topics(), max_size=8, unique_by=lambda topic: topic.name))
    samples: Mapping[str, Any] = {
        topic.name: message(draw, topic.type) for topic in drawn if draw(some.booleans())
    }
    return Known(
        topics=drawn,
        services=draw(some.lists(servers(SERVICES), max_size=4)),
        actions=draw(some.lists(servers(ACTIONS), max_size=2)),
        parameters=draw(some.lists(parameters(), max_size=4)),
        samples=samples,
        periods={topic.name: draw(some.floats(1e-9, 60)) for topic in drawn},
        unreadable=draw(some.lists(names, max_size=1)),
    )


@given(robots(), some.booleans())
def test_scaffold_of_any_robot_passes_check(known: Known, live: bool) -> None:
    draft, faults = checked_draft(
        partial(make_draft, known, INTERFACES, Draft(title="Cell"), live),
        partial(faults_of_text, folder=Path()),
    )
    assert faults == ()
    for ways in ({}, {"controls": True}, {"trial": True}):
        assert faults_of_text(toml_text(draft, **ways), Path()) == ()

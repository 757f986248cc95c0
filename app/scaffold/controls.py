"""The widgets that act on the robot: keys for topics, services and actions, and parameters."""

from collections.abc import Collection, Iterator, Mapping
from textwrap import shorten
from typing import Any, Final

from app.interfaces import Interfaces
from app.interfaces.definitions import FLOAT_TYPES
from app.scaffold.draft_parts import DraftWidget, Omission
from app.scaffold.fields import NUMBERS
from app.scaffold.naming import label_of, place_of, words_of
from app.scaffold.reasons import NO_MESSAGE
from app.survey.model import Server, SurveyedTopic
from app.survey.node_services import NodeParameter

TWISTS: Final = ("geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped")
OF_EVERY_NODE: Final = (
    "rcl_interfaces/srv/",
    "type_description_interfaces/srv/",
    "logging_demo/srv/",
    "composition_interfaces/srv/",
    "lifecycle_msgs/srv/",
)
PARAMETER_TYPES: Final = ("bool", "integer", "double", "string")
MAX_COMMENT: Final = 200  # characters of a value, and of a description
ROLES: Final = {"start": "start", "stop": "stop", "reset": "reset"}


def publishers(topic: SurveyedTopic, interfaces: Interfaces) -> Iterator[DraftWidget | Omission]:
    """Keys that publish on a topic that the robot listens to."""
    nodes = {node for subscriber in topic.subscribers for node in subscriber.nodes}
    about = {"label": label_of(topic.name), "topic": topic.name, "type": topic.type}
    if topic.type in TWISTS:
        keys = {**about, "span": 6}
        yield _control("joystick", topic.name, nodes, keys, "Moves the robot while it is held.")
        return
    message = _message(topic.type, interfaces)
    if message is None:
        yield Omission(f"{topic.name} ({topic.type})", NO_MESSAGE)
        return
    keys = {**about, "message": message, **_role(topic.name)}
    yield _control("publish", topic.name, nodes, keys)


def _message(type_name: str, interfaces: Interfaces) -> dict[str, Any] | None:
    """What a key of a type with one plain field sends; None for a type that needs thought."""
    fields = interfaces.structures[type_name].fields
    if not fields:
        return {}
    (field, *more) = fields
    if more or field.type.is_nested or field.type.container != "one":
        return None
    if field.type.name in NUMBERS:
        return {field.name: 0.0 if field.type.name in FLOAT_TYPES else 0}
    return {field.name: True if field.type.name == "bool" else "text"}


def calls(service: Server, interfaces: Interfaces) -> Iterator[DraftWidget]:
    """Keys that call a service whose request is empty or one bool."""
    if service.type.startswith(OF_EVERY_NODE):
        return
    request, _ = interfaces.service_types(service.type)
    fields = interfaces.structures[request].fields
    about = {"service": service.name, "type": service.type}
    label = label_of(service.name)
    if not fields:
        keys = {"label": label, **about, **_role(service.name)}
        yield _control("call", service.name, service.nodes, keys)
    elif [str(field.type) for field in fields] == ["bool"]:
        for value, word in ((True, "on"), (False, "off")):
            labelled: dict[str, Any] = {
                "label": f"{label} {word}",
                **about,
                "request": {fields[0].name: value},
            }
            yield _control("call", service.name, service.nodes, labelled, id_word=word)


def goals(action: Server, interfaces: Interfaces) -> Iterator[DraftWidget]:
    """A key that sends a goal with default values."""
    goal = interfaces.action_types(action.type).goal
    fields = interfaces.structures[goal].fields
    plain = {field.name: field.default_value for field in fields if not field.type.is_nested}
    keys = {"label": label_of(action.name), "action": action.name, "type": action.type, "goal": plain}
    comment = "Fill in the goal." if fields else ""
    yield _control("action", action.name, action.nodes, keys, comment)


def parameter(declared: NodeParameter) -> Iterator[DraftWidget]:
    """An entry for a parameter that can be set."""
    kind = declared.type.removesuffix("[]")
    hidden = declared.name.startswith("qos_overrides.") or declared.name == "use_sim_time"
    if kind not in PARAMETER_TYPES or declared.read_only or hidden:
        return
    labelled: dict[str, Any] = {
        "label": label_of("/" + declared.name.replace(".", "/")),
        "node": declared.node,
        "parameter": declared.name,
        "type": declared.type,
        "span": 6,
    }
    now = shorten(repr(declared.value), MAX_COMMENT, placeholder=" …")
    about = shorten(declared.description, MAX_COMMENT, placeholder=" …")
    comment = f"Now {now}. {about}".strip() if declared.value is not None else ""
    yield _control("parameter", f"{declared.node}/{declared.name}", (declared.node,), labelled, comment)


def _role(name: str) -> Mapping[str, str]:
    last = words_of(name.rpartition("/")[2])
    return next(({"role": ROLES[word]} for word in last if word in ROLES), {})


def _control(
    kind: str,
    name: str,
    nodes: Collection[str],
    keys: Mapping[str, Any],
    comment: str = "",
    id_word: str = "",
) -> DraftWidget:
    own_name = f"{name}/{id_word}" if id_word else name
    scope = name.rpartition("/")[0]
    return DraftWidget(
        kind=kind,
        name=own_name,
        keys=keys,
        comment=comment,
        control=True,
        place=place_of(name, nodes),
        scope=f"/{scope.strip('/')}" if scope.strip("/") else "",
        nodes=tuple(sorted(nodes)),
    )

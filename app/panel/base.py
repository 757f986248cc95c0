"""Base class and field types of the descriptions: checked names, ids, icons, QoS."""

import re
from collections.abc import Mapping
from functools import cache, cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal, NamedTuple, Protocol, Self

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    TypeAdapter,
    ValidationInfo,
    ValidatorFunctionWrapHandler,
    WithJsonSchema,
    WrapValidator,
)

from app.panel.file.wording import closest_name
from app.ros.messages import field_call
from app.ros.messages.field_path import Key, path_steps
from app.ros.messages.names import (
    ACTION_TYPE,
    GLOBAL,
    MESSAGE_TYPE,
    NAMESPACE,
    SERVICE_TYPE,
    TOPIC,
    Qos,
)
from app.ros.messages.validation import format_value
from app.system.errors import InterfaceError
from app.system.pictures import icons, picture_files
from app.system.public import PUBLIC, PUBLIC_ENDPOINT, PUBLIC_FIELD
from app.system.texts import ENGLISH, PanelText, TextLike, render, say


class FileContext(NamedTuple):
    """What the values of a panel file are checked with: the file's folder, and the panel's language."""

    folder: Path = Path()
    language: str = ENGLISH


def _context(info: ValidationInfo) -> FileContext:
    return info.context or FileContext()


def is_absolute_name(name: str) -> bool:
    """Whether it is the absolute name of a topic, service, action or node; a second slash at the
    beginning says that it is not below the panel's namespace."""
    own = name.removeprefix("/") if name.startswith(GLOBAL) else name
    return TOPIC.fullmatch(own) is not None and "__" not in own


def _check_topic(name: str) -> str:
    if not is_absolute_name(name):
        raise ValueError(
            f'{format_value(name)} is not an absolute ROS 2 topic name: it starts with "/" ("//": not '
            'below the namespace), and each part is letters, digits and single "_", and starts with no '
            "digit"
        )
    return name


def _check_message_type(type_name: str) -> str:
    if not MESSAGE_TYPE.fullmatch(type_name):
        raise ValueError(
            f"{format_value(type_name)} is not a ROS 2 message type: it must be like std_msgs/msg/Bool"
        )
    return type_name


def _check_service_type(type_name: str) -> str:
    if not SERVICE_TYPE.fullmatch(type_name):
        raise ValueError(
            f"{format_value(type_name)} is not a ROS 2 service type: it must be like "
            "std_srvs/srv/SetBool"
        )
    return type_name


def _check_message_or_service_type(type_name: str) -> str:
    return _check_service_type(type_name) if "/srv/" in type_name else _check_message_type(type_name)


def _check_node(name: str) -> str:
    if not is_absolute_name(name):
        raise ValueError(
            f"{format_value(name)} is not the absolute name of a ROS 2 node: it must be like /cell1/arm"
        )
    return name


def _check_action_type(type_name: str) -> str:
    if not ACTION_TYPE.fullmatch(type_name):
        raise ValueError(
            f"{format_value(type_name)} is no ROS 2 action type: "
            "it must be like nav2_msgs/action/NavigateToPose"
        )
    return type_name


def catalogue_default(code: str) -> Any:
    """A field whose default is a text of the catalogue, rendered in the language of each reader."""

    def described(schema: dict[str, Any]) -> None:
        schema["default"] = render(say(code))

    return Field(default_factory=lambda: say(code), json_schema_extra=described)


def parse_namespace(namespace: str) -> str:
    whole = f"/{namespace.strip('/')}" if namespace.strip("/") else ""
    if not NAMESPACE.fullmatch(whole) or "__" in whole:
        raise ValueError(f"{format_value(namespace)} is not a ROS 2 namespace: it must be like /robot1")
    return whole


def _check_endpoint(endpoint: str) -> str:
    """Checks a Zenoh endpoint; Zenoh itself reports a malformed one only when the session opens."""
    parts = ENDPOINT.fullmatch(endpoint)
    if parts is None or not 0 < int(parts["port"] or 1) <= MAX_PORT:
        raise ValueError(
            f"{format_value(endpoint)} is not a Zenoh endpoint: it must be like tcp/robot1:7447"
        )
    return endpoint


def _check_whole_path(path: str) -> str:
    if not path.startswith("/"):
        raise ValueError(f"{format_value(path)} is not the whole path of a file, from / on")
    return path


def _resolve_folder(value: Any, info: ValidationInfo) -> Path:
    """The folder's path, relative to the panel file's folder: of interfaces, or `pictures`."""
    if not isinstance(value, str) or not value:
        raise ValueError(f"must be the path of a folder, not {format_value(value)}")
    folder = _context(info).folder / value
    if not folder.is_dir():
        right = "it must be a ROS package or have some in it"
        right = "put pictures into one here" if info.field_name == "pictures" else right
        raise ValueError(f"{folder} is not a folder: {right}")
    return folder


def _resolve_file(value: Any, info: ValidationInfo) -> Path:
    """The file's path, relative to the panel file's folder."""
    if not isinstance(value, str) or not value:
        raise ValueError(f"must be the path of a file, not {format_value(value)}")
    folder = _context(info).folder
    file = folder / value
    if not file.is_file():
        raise ValueError(f"{file} is not a file: the path is relative to the panel file")
    if not is_inside(file, folder):
        raise ValueError(
            f"{file} is not below the panel file's folder, or is a link that leads out of it: put the"
            f' file itself there, and name it like "pages/{file.name}"'
        )
    return file


def _check_pictures(folder: Path, info: ValidationInfo) -> Path:
    """Links out of it are not followed: the server sends pictures to everyone."""
    for file in picture_files(folder).values():
        if not is_inside(file, folder, _context(info).folder):
            raise ValueError(
                f"{file} is a link to {file.resolve()}, which is not below the folder of pictures: put"
                " the picture itself there"
            )
    return folder


def is_inside(file: Path, *folders: Path) -> bool:
    """Whether a file really is below one of the folders, with all links followed."""
    return any(file.resolve().is_relative_to(folder.resolve()) for folder in folders)


def _parse_interlocks(value: Any) -> tuple[str, ...]:
    """The ids, from one id or a list of them."""
    named = [value] if isinstance(value, str | dict) else value
    if not isinstance(named, list | tuple):
        raise ValueError(f"must be the id of an interlock, or a list of ids, not {format_value(value)}")
    if not named:
        raise ValueError("is an empty list: name an interlock, or leave the key out")
    if any(isinstance(name, dict) for name in named):
        raise ValueError(
            "must be an id, or a list of ids: write the table by itself, such as [[interlock]] with an "
            'id, and name the id here, such as "door_closed"'
        )
    for name in named:
        if not isinstance(name, str) or not re.fullmatch(ID, name):
            raise ValueError(f'{format_value(name)} is not an id: a-z, 0-9 and "_", a letter first')
    return each_once(tuple(named))


def non_empty(values: tuple[Any, ...]) -> tuple[Any, ...]:
    """ValueError for an empty list."""
    if not values:
        raise ValueError("is empty: it must have one at least")
    return values


def each_once(values: tuple[Any, ...]) -> tuple[Any, ...]:
    """ValueError for a list that names a value twice."""
    for i, value in enumerate(values):
        if value in values[:i]:
            raise ValueError(f"names {format_value(value)} twice")
    return values


def distinct(values: tuple[Any, ...]) -> tuple[Any, ...]:
    """The same for a list that may not be empty."""
    return each_once(non_empty(values))


@cache
def _texts(least: int, most: int | None) -> TypeAdapter[dict[str, str]]:
    text = Annotated[str, Field(min_length=least, max_length=most)]
    table = Annotated[dict[str, text], Field(min_length=1)]
    return TypeAdapter(table, config=ConfigDict(strict=True))


def panel_text(most: int | None = None, least: int = 1) -> Any:
    """The type of a text that an operator reads, of `least` to `most` characters: a text, or a table of
    texts by their languages, `{ en = "Start", ja = "始動" }`."""

    def by_language(value: Any, text: ValidatorFunctionWrapHandler, info: ValidationInfo) -> Any:
        if not isinstance(value, Mapping):
            return text(value)
        return PanelText(_texts(least, most).validate_python(value), _context(info).language)

    limits = {"minLength": least} if least else {}
    limits |= {} if most is None else {"maxLength": most}
    text_schema = {"type": "string", **limits}
    table = {"type": "object", "title": TEXTS, "additionalProperties": text_schema, "minProperties": 1}
    return Annotated[
        str,
        Field(min_length=least, max_length=most),
        WrapValidator(by_language),
        WithJsonSchema({"anyOf": [text_schema, table]}),
    ]


TEXTS: Final = "table of texts by language"
# The protocols are those of Zenoh for Python; metadata and settings follow the address.
ENDPOINT: Final = re.compile(
    r"(?:(?:tcp|udp|tls|quic|ws)/[^\s/?#]+:(?P<port>[0-9]{1,5})|unixsock-stream/[^\s?#]+)"
    r"(?:\?[^\s?#]+)?(?:#[^\s#]+)?"
)
MAX_PORT: Final = 65535
ID: Final = r"^[a-z][a-z0-9_]{0,63}$"
Id = Annotated[str, Field(pattern=ID), PUBLIC]
Interlocks = Annotated[tuple[str, ...], BeforeValidator(_parse_interlocks), PUBLIC]
# Texts that an operator reads. A `SaidLabel` may be left to the catalogue: Pydantic knows only of what
# a file gives.
if TYPE_CHECKING:
    Label = str | PanelText
    Note = str | PanelText
    AnyText = str | PanelText
    SaidLabel = TextLike
else:
    Label = SaidLabel = panel_text(120)
    Note = panel_text(40)
    AnyText = panel_text(least=0)
Span = Annotated[int, Field(ge=1, le=12), PUBLIC]
Rows = Annotated[int, Field(ge=1, le=8), PUBLIC]
TopicName = Annotated[str, AfterValidator(_check_topic), Field(max_length=255), PUBLIC]
Type = Annotated[str, AfterValidator(_check_message_type), PUBLIC]
ServiceType = Annotated[str, AfterValidator(_check_service_type), PUBLIC]
MessageOrServiceType = Annotated[str, AfterValidator(_check_message_or_service_type), PUBLIC]
NodeName = Annotated[str, AfterValidator(_check_node), Field(max_length=200), PUBLIC]
ParameterName = Annotated[str, Field(pattern=r"^[^\s\x00-\x1f]+$", max_length=255)]
ActionType = Annotated[str, AfterValidator(_check_action_type), PUBLIC]
Endpoint = Annotated[str, AfterValidator(_check_endpoint), PUBLIC_ENDPOINT]
Folder = Annotated[Path, BeforeValidator(_resolve_folder)]
PictureFolder = Annotated[Folder, AfterValidator(_check_pictures)]
File = Annotated[Path, BeforeValidator(_resolve_file)]
FiniteNumber = Annotated[float, Field(allow_inf_nan=False)]
# Where a secret is: never in the panel file itself.
SecretVariable = Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]*$", max_length=100)]
SecretFile = Annotated[str, AfterValidator(_check_whole_path)]
Seconds = Annotated[float, Field(gt=0, le=86400, allow_inf_nan=False), PUBLIC]


class Description(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, defer_build=True)

    def model_copy(self, *, update: Mapping[str, Any] | None = None, deep: bool = False) -> Self:
        """A copy without the original's cached properties, which depend on its fields."""
        copied = super().model_copy(update=update, deep=deep)
        for name in copied.__dict__.keys() - type(copied).model_fields:
            del copied.__dict__[name]
        return copied


class TopicQos(Description):
    """A topic's QoS. Without `durability`, a publisher is volatile and a subscription uses the
    publisher's. Without `reliability` it is reliable; a topic that is only shown uses the
    publisher's."""

    reliability: Literal["reliable", "best_effort"] | None = None
    durability: Literal["volatile", "transient_local"] | None = None
    depth: Annotated[int, Field(ge=1, le=10_000), PUBLIC] = 10

    @cached_property
    def wire_qos(self) -> Qos:
        return Qos(self.reliability != "best_effort", self.durability == "transient_local", self.depth)


class HasTopic(Protocol):
    """Anything with a topic, its type and its QoS."""

    @property
    def topic(self) -> str: ...
    @property
    def type(self) -> str: ...
    @property
    def qos(self) -> TopicQos: ...


def _check_icon(name: str) -> str:
    if name in icons():
        return name
    meant = closest_name(name.lower(), icons())
    hint = f'did you mean "{meant}"?' if meant else "docs/reference/icons.md lists them"
    raise ValueError(f"{format_value(name)} is not one of the shipped icons: {hint}")


Icon = Annotated[str, AfterValidator(_check_icon)]


# The types of keys that name a field of a message.


def _check_field_path(path: str) -> str:
    try:
        if field_call(path) is None:
            path_steps(path)
    except InterfaceError as error:
        raise ValueError(str(error)) from None
    return path


def _check_message_field(path: str) -> str:
    if field_call(_check_field_path(path)) is not None:
        raise ValueError(f'"{path}" is a function of fields: here it must be a field')
    return path


def _check_written_field(path: str) -> str:
    if any(isinstance(step, Key) for step in path_steps(_check_message_field(path))):
        raise ValueError(f'"{path}" is filled in: an element is given by its number, as in data[2]')
    return path


FieldPath = Annotated[str, AfterValidator(_check_field_path), PUBLIC_FIELD]  # or a function of fields
MessageField = Annotated[str, AfterValidator(_check_message_field), PUBLIC_FIELD]
WrittenField = Annotated[str, AfterValidator(_check_written_field)]  # without keys

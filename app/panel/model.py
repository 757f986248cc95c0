"""The descriptions that a panel file becomes. What a key means is in the README."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Final, Literal

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationInfo

from app.keys import MESSAGE_TYPE, NAMESPACE, TOPIC


def _topic(given: str) -> str:
    if not TOPIC.fullmatch(given) or "__" in given:
        raise ValueError(
            f'"{given}" is not an absolute ROS 2 topic name: it starts with "/", and each part is '
            'letters, digits and single "_", and starts with no digit'
        )
    return given


def _type(given: str) -> str:
    if not MESSAGE_TYPE.fullmatch(given):
        raise ValueError(f'"{given}" is not a ROS 2 message type: it must be like std_msgs/msg/Bool')
    return given


def _namespace(given: str) -> str:
    whole = f"/{given.strip('/')}" if given.strip("/") else ""
    if not NAMESPACE.fullmatch(whole) or "__" in whole:
        raise ValueError(f'"{given}" is not a ROS 2 namespace: it must be like /robot1')
    return whole


def _folder(given: Any, info: ValidationInfo) -> Path:
    """Relative to the panel file's folder, which is the context of the validation."""
    if not isinstance(given, str) or not given:
        raise ValueError(f"must be the path of a folder, not {given!r}")
    folder = Path(info.context or "") / given
    if not folder.is_dir():
        raise ValueError(f"{folder} is not a folder: it must be a ROS package or have some in it")
    return folder


ID: Final = r"^[a-z][a-z0-9_]{0,63}$"
Id = Annotated[str, Field(pattern=ID)]
Label = Annotated[str, Field(min_length=1, max_length=120)]
Topic = Annotated[str, AfterValidator(_topic), Field(max_length=255)]
Type = Annotated[str, AfterValidator(_type)]
_STEP: Final = r"[a-z][a-z0-9_]*(\[[0-9]{1,9}\])*"
FieldPath = Annotated[str, Field(pattern=rf"^{_STEP}(\.{_STEP})*$")]
Folder = Annotated[Path, BeforeValidator(_folder)]
Seconds = Annotated[float, Field(gt=0, le=86400, allow_inf_nan=False)]


class Description(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class Interlock(Description):
    """A Bool field of the robot's that permits; never seen, stale or cut off locks."""

    id: Id
    label: Label | None = None
    topic: Topic
    type: Type = "std_msgs/msg/Bool"
    field: FieldPath = "data"
    max_age_s: Seconds | None = None
    require_publisher: bool = False

    @property
    def name(self) -> str:
        return self.label or self.id


class Placed(Description):
    """What every widget has; `span` is its width in twelfths of the page."""

    id: Id
    label: Label
    span: Annotated[int, Field(ge=1, le=12)] = 12


class TextInput(Placed):
    kind: Literal["text"]
    max_length: Annotated[int, Field(ge=1, le=1000)] = 80
    default: Annotated[str, Field(pattern=r"^[^\x00]*$")] = ""


class Publish(Placed):
    kind: Literal["publish"]
    topic: Topic
    type: Type
    message: dict[str, Any]
    interlock: Id | None = None
    span: Annotated[int, Field(ge=1, le=12)] = 4


class Readout(Placed):
    kind: Literal["readout"]
    topic: Topic
    type: Type
    field: FieldPath = "data"
    max_age_s: Seconds | None = None


Widget = Annotated[TextInput | Publish | Readout, Field(discriminator="kind")]
KINDS: Final[Mapping[str, type[Placed]]] = {"text": TextInput, "publish": Publish, "readout": Readout}


class Page(Description):
    id: Id
    title: Label
    widgets: Annotated[tuple[Widget, ...], Field(strict=False)] = Field((), alias="widget")


class Panel(Description):
    title: Label
    mode: Literal["demo", "live"] = "live"
    language: Literal["en"] = "en"
    distro: Literal["humble", "iron", "jazzy", "kilted"] = "jazzy"
    interfaces: Annotated[tuple[Folder, ...], Field(strict=False)] = ()
    namespace: Annotated[str, AfterValidator(_namespace)] = ""
    mm_per_px: Annotated[float, Field(gt=0.02, lt=1)] = 0.22
    interlocks: Annotated[tuple[Interlock, ...], Field(strict=False)] = Field((), alias="interlock")
    pages: Annotated[tuple[Page, ...], Field(strict=False)] = Field(alias="page")
    # Of the file, not in it: changes when what a browser has loaded is out of date.
    revision: Annotated[str, Field(exclude=True)] = ""

    def widgets(self) -> Iterator[TextInput | Publish | Readout]:
        for page in self.pages:
            yield from page.widgets

    def page(self, page_id: str) -> Page | None:
        return next((page for page in self.pages if page.id == page_id), None)

    def interlock(self, interlock_id: str | None) -> Interlock | None:
        return next((i for i in self.interlocks if i.id == interlock_id), None)

    def subscriptions(self) -> dict[str, str]:
        """Topic → type of all that the panel listens to."""
        listened = {i.topic: i.type for i in self.interlocks}
        return listened | {w.topic: w.type for w in self.widgets() if isinstance(w, Readout)}

    def publications(self) -> dict[str, str]:
        """Topic → type of all that the panel publishes."""
        return {w.topic: w.type for w in self.widgets() if isinstance(w, Publish)}

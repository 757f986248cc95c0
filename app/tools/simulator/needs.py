"""What widgets need of the simulated robot."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from app.panel.base import TopicQos
from app.panel.widgets.parameter import Parameter
from app.panel.widgets.publish import Confirm

DEFAULT_QOS: Final = TopicQos()


@dataclass(frozen=True, slots=True, kw_only=True)
class DisplayedField:
    """A field that the panel shows. `low` and `high` are limits of the number in the message, `values`
    the values that the widget distinguishes. Times `scale` plus `offset` the number has the `unit`. It
    rises by one each `counts_s` seconds."""

    topic: str
    type: str
    field: str
    label: str = ""
    unit: str = ""
    scale: float = 1.0
    offset: float = 0.0
    low: float | None = None
    high: float | None = None
    values: tuple[Any, ...] = ()
    max_age_s: float | None = None
    counts_s: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Published:
    """A topic that the panel publishes; the robot confirms a press of `template` by `confirm`."""

    topic: str
    type: str
    qos: TopicQos = DEFAULT_QOS
    template: Mapping[str, Any] | None = None
    confirm: Confirm | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Served:
    """A service that the panel calls; `success`, `message` and `listed` (texts to choose from) are
    paths in its response."""

    service: str
    type: str
    success: str | None = None
    message: str | None = None
    listed: str | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Acted:
    """An action that the panel sends goals to; its feedback's field `progress` has these `ends`."""

    action: str
    type: str
    progress: str | None = None
    ends: tuple[float, float] = (0.0, 100.0)
    shown: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Declared:
    """A parameter of a node."""

    widget: Parameter


Need = DisplayedField | Published | Served | Acted | Declared

"""The description of one of several robots: `[[robot]]`."""

from functools import cached_property
from typing import Annotated, Any, Final

from pydantic import AfterValidator, Field

from app.dialect.dialect import DEFAULT_DIALECT, DOMAIN_MOST, DialectName
from app.panel.base import (
    Description,
    Endpoint,
    Id,
    Label,
    Seconds,
    TopicName,
    TopicQos,
    Type,
    parse_namespace,
)
from app.panel.field_paths import FieldPath
from app.panel.number_format import Factor
from app.panel.widgets.displays import FORMAT_OR_TIME, Readout
from app.panel.widgets.numbers import Unit

Domain = Annotated[int, Field(ge=0, le=DOMAIN_MOST)]
TILE: Final = "-tile-"  # no widget has an id that begins like this
SUMS: Final = "-sums"  # the line of sums of an overview


class RobotOverview(Description):
    """The figure of a robot on its tile of an overview."""

    label: Label | None = None
    topic: TopicName
    type: Type
    field: FieldPath = "data"
    max_age_s: Seconds | None = None
    qos: TopicQos = TopicQos()
    unit: Unit = ""
    scale: Factor = 1.0
    offset: Factor = 0.0
    format: Annotated[str, Field(pattern=FORMAT_OR_TIME)] | None = None


class RobotEntry(Description):
    """One of several robots; `connect` are its endpoints, by default the Zenoh configuration's."""

    id: Id
    name: Label
    namespace: Annotated[str, AfterValidator(parse_namespace)] = ""
    connect: Annotated[tuple[Endpoint, ...], Field(strict=False)] = ()
    dialect: DialectName = DEFAULT_DIALECT
    domain: Domain = 0
    overview: RobotOverview | None = None

    @property
    def tile_id(self) -> str:
        """The id of its tile on an overview."""
        return f"{TILE}{self.id}"

    @cached_property
    def figure(self) -> Readout | None:
        """The figure on its tile, as a readout of its own that is on no page."""
        if self.overview is None:
            return None
        shown: dict[str, Any] = {
            name: getattr(self.overview, name) for name in RobotOverview.model_fields
        }
        own = {"id": f"-figure-{self.id}", "kind": "readout", "label": self.name, "robot": self.id}
        return Readout.model_construct(**{**shown, **own})

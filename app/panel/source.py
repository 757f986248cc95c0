"""Topics that several tables of a panel file name by an id: `[[source]]`."""

from typing import Annotated, Final

from pydantic import AfterValidator, BaseModel, Field

from app.panel.base import Description, FieldPath, Id, Seconds, TopicName, TopicQos, Type, non_empty
from app.panel.numbers import Factor
from app.panel.recipe import RecipeSet
from app.panel.widgets.displays import FORMAT_OR_TIME, LampState
from app.panel.widgets.families import PublishCommand
from app.panel.widgets.numbers import Unit

NAME: Final = "source"


class Source(Description):
    """A topic with its type, and how one field of it is read and shown."""

    id: Id
    topic: TopicName
    type: Type
    qos: TopicQos | None = None
    field: FieldPath | None = None
    max_age_s: Seconds | None = None
    unit: Unit = ""
    scale: Factor | None = None
    offset: Factor | None = None
    format: Annotated[str, Field(pattern=FORMAT_OR_TIME)] | None = None
    states: Annotated[tuple[LampState, ...], Field(strict=False), AfterValidator(non_empty)] | None = (
        None
    )


def reads_source(model: type[BaseModel]) -> bool:
    """Whether a table of this description may name a source: it reads a topic."""
    keys = model.model_fields
    publishes = issubclass(model, PublishCommand | RecipeSet)
    return "topic" in keys and "type" in keys and not publishes and model is not Source

"""Topics that several tables of a panel file name by an id: `[[source]]`."""

from typing import Final

from pydantic import BaseModel

from app.panel.base import FieldPath, FiniteNumber, Id, TopicName, TopicQos, Type
from app.panel.recipe import RecipeSet
from app.panel.shared_keys import AgeKey, NumberOrTimeFormat, Unit
from app.panel.widgets.displays import States
from app.panel.widgets.families import PublishCommand

NAME: Final = "source"


class Source(AgeKey):
    """A topic with its type, and how one field of it is read and shown."""

    id: Id
    topic: TopicName
    type: Type
    qos: TopicQos | None = None
    field: FieldPath | None = None
    unit: Unit = ""
    scale: FiniteNumber | None = None
    offset: FiniteNumber | None = None
    format: NumberOrTimeFormat | None = None
    states: States | None = None


def reads_source(model: type[BaseModel]) -> bool:
    """Whether a table of this description may name a source: it reads a topic."""
    keys = model.model_fields
    publishes = issubclass(model, PublishCommand | RecipeSet)
    return "topic" in keys and "type" in keys and not publishes and model is not Source

"""Where the options of a select come from, if the robot has them: a list of texts on a topic."""

from collections.abc import Iterator
from typing import Final

from app.errors import Fault
from app.interfaces import STRING_TYPES, Interfaces
from app.panel.base import Description, Seconds, TopicName, TopicQos, Type
from app.panel.checks.types import field_faults
from app.panel.field_paths import MessageField
from app.panel.widgets.families import TopicSource

MOST: Final = 200  # options that are shown; a press with a later one is refused
KEY: Final = "options_from"


class RobotOptions(Description):
    """A field of a topic that is a list of texts. Older than `max_age_s` it is not known."""

    topic: TopicName
    type: Type
    field: MessageField = "data"
    max_age_s: Seconds | None = None
    qos: TopicQos = TopicQos()

    def source(self) -> TopicSource:
        """Its topic."""
        return TopicSource(self.topic, self.type, self.qos, (self.field,), KEY)

    def faults(self, place: str, interfaces: Interfaces) -> Iterator[Fault]:
        """Faults of a field that is no list of texts."""
        faults = list(field_faults(place, self.type, self.field, interfaces))
        yield from faults
        kind = None if faults else interfaces.type_at(self.type, self.field)
        if kind is not None and (kind.container == "one" or kind.name not in STRING_TYPES):
            message = f'"{self.field}" is {kind}: options are a list of texts, like string[]'
            yield Fault(f"{place}.field", message)

"""What commands that send one message, request or goal have in common."""

from abc import abstractmethod
from collections.abc import Iterator
from typing import ClassVar

from app.errors import Fault, InterfaceError
from app.interfaces import Interfaces
from app.panel.checks.templates import template_faults
from app.panel.checks.types import type_fault
from app.panel.widgets.families import Checking, Pressed, Sent


class Templated(Pressed):
    """A press that fills in a template of one type."""

    part: ClassVar[str]  # the key that holds the template

    @property
    @abstractmethod
    def does(self) -> str:
        """What a press does, with the types that the panel file names: "publishes /a (a/msg/B)"."""

    @abstractmethod
    def sent_type(self, interfaces: Interfaces) -> str:
        """The type of what is sent; InterfaceError if it is not there."""

    def sent(self, interfaces: Interfaces) -> Iterator[Sent]:
        yield Sent(self.does, self.sent_type(interfaces), self.template)

    def faults(self, place: str, checking: Checking) -> Iterator[Fault]:
        yield from super().faults(place, checking)
        try:
            type_name = self.sent_type(checking.interfaces)
        except InterfaceError as error:
            yield type_fault(f"{place}.type", error)
            return
        yield from template_faults(f"{place}.{self.part}", self.template, type_name, checking)
        yield from self.answer_faults(place, checking)

    def answer_faults(self, place: str, checking: Checking) -> Iterator[Fault]:
        """What is wrong in the keys about what comes of a press."""
        yield from ()

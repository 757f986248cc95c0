"""The family of commands that send one message, request or goal."""

from abc import abstractmethod
from collections.abc import Iterator
from typing import ClassVar

from app.panel.checks.templates import template_faults
from app.panel.checks.types import type_fault
from app.panel.widgets.families import CheckContext, Command, KeyCommand, PressCommand, SentMessage
from app.ros.messages import Interfaces
from app.system.errors import Fault, InterfaceError


class TemplateCommand(KeyCommand, PressCommand):
    """A press that sends a filled template of one type."""

    template_key: ClassVar[str]  # the key that holds the template

    @property
    @abstractmethod
    def action_text(self) -> str:
        """What a press does, for a preview: "publishes /a (a/msg/B)"."""

    @abstractmethod
    def template_type(self, interfaces: Interfaces) -> str:
        """The message type of the template; InterfaceError if it does not exist."""

    def sent_messages(self, interfaces: Interfaces) -> Iterator[SentMessage]:
        yield SentMessage(self.action_text, self.template_type(interfaces), self.template)

    def faults(self, place: str, checking: CheckContext) -> Iterator[Fault]:
        yield from super().faults(place, checking)
        try:
            type_name = self.template_type(checking.interfaces)
        except InterfaceError as error:
            yield type_fault(f"{place}.type", error)
            return
        yield from template_faults(f"{place}.{self.template_key}", self.template, type_name, checking)
        yield from self.response_faults(place, checking)

    def response_faults(self, place: str, checking: CheckContext) -> Iterator[Fault]:
        """Faults of the keys about the response."""
        yield from ()


def is_stop(widget: Command) -> bool:
    """Whether it stops the machine."""
    return isinstance(widget, KeyCommand) and widget.role == "stop"


def needs_control(widget: Command) -> bool:
    """Whether only a client in control may press or hold it, if the panel requires control: all but a
    press that stops."""
    return not (isinstance(widget, TemplateCommand) and is_stop(widget))

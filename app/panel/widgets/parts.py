"""The family of commands that send by other commands."""

from abc import abstractmethod

from app.panel.widgets.families import Command, PressCommand


class CompositeCommand(PressCommand):
    """A command whose press is sent by one of its parts."""

    @property
    @abstractmethod
    def parts(self) -> tuple[Command, ...]:
        """The commands by which it sends."""


def parts_of(command: Command) -> tuple[Command, ...]:
    """The commands by which a command sends: itself, or its parts."""
    return command.parts if isinstance(command, CompositeCommand) else (command,)

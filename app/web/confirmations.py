"""Presses that a person confirms: the question at a browser, and what a press has of its answer."""

from dataclasses import replace
from typing import Any, Final, TypeVar

from app.access.confirmer import Question
from app.commands.press import Press, fingerprint
from app.errors import NotFound
from app.panel.template import needed_inputs
from app.panel.widgets.confirmed import confirmation_of
from app.panel.widgets.families import Command
from app.runtime.robot_session import RobotSession
from app.web.app_state import AppState
from app.web.client_cookie import Caller

LONGEST_TOKEN: Final = 64

Widget = TypeVar("Widget", bound=Command)


def confirmed(state: AppState, who: Caller, press: Press[Widget], token: str) -> Press[Widget]:
    """The press, with who confirmed it, if the token is a confirmation of just this press."""
    if not token or not confirmation_of(press.widget):
        return press
    inputs = inputs_of(press.widget, press.inputs)
    by = state.confirmer.take(token, who.session, press.widget.id, inputs)
    return replace(press, confirmed=by)


def confirmed_command(session: RobotSession, widget: str) -> Command:
    """The command with this id that a person confirms; NotFound for every other id."""
    for command in session.panel.commands:
        if command.id == widget and confirmation_of(command):
            return command
    raise NotFound(f'there is no widget "{widget:.64}" that a person confirms')


def question_of(state: AppState, command: Command, inputs: dict[str, Any]) -> Question:
    """What a person confirms of a press with these inputs."""
    needs = state.fleet.panel.needs.commands.get(command.id, frozenset())
    return Question(command.id, inputs_of(command, inputs), confirmation_of(command), needs)


def inputs_of(command: Command, inputs: Any) -> str:
    """The fingerprint of the inputs that a press of the command takes."""
    return fingerprint(needed_inputs(command, inputs))

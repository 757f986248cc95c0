"""What a panel uses: ROS names, and the options and places that a robot has."""

from collections.abc import Mapping
from typing import TypeVar

from app.panel.demo import STORIES, Story, Use
from app.panel.model import Panel
from app.panel.template import input_ids
from app.panel.widgets.families import Input
from app.panel.widgets.inputs import SelectInput
from app.panel.widgets.place import MapInput
from app.panel.widgets.service_action import Action

AnyInput = TypeVar("AnyInput", bound=Input)

# The ROS names that a panel uses, by how it uses them.


def used_names(panel: Panel) -> Mapping[Use, Mapping[str, str]]:
    """Use → name → type. A topic is one that the panel listens to, a publication one that it
    publishes."""
    return {
        "topic": panel.listened(),
        "publication": panel.publications(),
        "service": panel.called_services(),
        "action": panel.actions(),
    }


def played_names(panel: Panel) -> Story | None:
    """The names that the simulated robot plays by the panel's story: those that the panel uses with the
    same types, and has no entry for. None without a story."""
    if panel.demo_story is None:
        return None
    used, entries = used_names(panel), panel.demo
    story = STORIES[panel.demo_story]

    def shared(use: Use, names: Mapping[str, str]) -> dict[str, str]:
        return {
            name: kind
            for name, kind in names.items()
            if used[use].get(name) == kind and name not in entries
        }

    return Story(
        publishes=shared("topic", story.publishes),
        subscribes=shared("publication", story.subscribes),
        services=shared("service", story.services),
        actions=shared("action", story.actions),
    )


# Which commands send a choice of options that the robot has, or a place.


def selects_by_command(panel: Panel) -> Mapping[str, tuple[SelectInput, ...]]:
    """The selects with `options_from` that a command's message has, by the command's id."""
    return _by_command(panel, panel.listed_selects)


def places_by_command(panel: Panel) -> Mapping[str, tuple[MapInput, ...]]:
    """The places that a command's message has, by the command's id."""
    return _by_command(panel, panel.map_inputs)


def actions_of_tours(panel: Panel) -> Mapping[str, tuple[Action, ...]]:
    """The actions whose goals a tour shows, by the tour's id: the one that it names, else those that
    send it."""
    if not panel.tours:
        return {}
    actions = [command for command in panel.commands if isinstance(command, Action)]
    return {
        tour.id: tuple(
            action
            for action in actions
            if (action.id == tour.action if tour.action else tour.id in input_ids(action))
        )
        for tour in panel.tours
    }


def _by_command(panel: Panel, inputs: tuple[AnyInput, ...]) -> Mapping[str, tuple[AnyInput, ...]]:
    known = {widget.id: widget for widget in inputs}
    if not known:
        return {}
    used = {
        command.id: tuple(known[name] for name in input_ids(command) if name in known)
        for command in panel.commands
    }
    return {command: choices for command, choices in used.items() if choices}

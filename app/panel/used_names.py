"""The ROS names that a panel uses, by how it uses them."""

from collections.abc import Mapping

from app.panel.model import Panel
from app.panel.stories import STORIES, Story, Use
from app.panel.used_options import listing_services
from app.panel.widgets.service_action import ServerCommand


def used_names(panel: Panel) -> Mapping[Use, Mapping[str, str]]:
    """Use → name → type. A topic is one that the panel listens to, a publication one that it
    publishes."""
    servers = [widget for widget in panel.senders() if isinstance(widget, ServerCommand)]
    listed = {service.name: service.type for service in listing_services(panel)}
    return {
        "topic": panel.listened(),
        "publication": panel.publications(),
        "service": listed
        | {server.server_name: server.type for server in servers if server.server_role == "SS"},
        "action": {server.server_name: server.type for server in servers if server.server_role == "AS"},
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

"""Checks of `demo_story`: names with other types than the story plays, or none that the panel uses."""

from collections.abc import Iterator

from app.errors import Fault
from app.panel.faults.wording import list_names
from app.panel.model import Panel
from app.panel.stories import STORIES
from app.panel.used_names import used_names


def story_faults(panel: Panel) -> Iterator[Fault]:
    """The faults of a story. By their cause they are consequences of faults of subscriptions."""
    if panel.demo_story is None:
        return
    names = used_names(panel)
    played = list(STORIES[panel.demo_story].types)
    used = False
    for use, name, wanted in played:
        panel_type = names[use].get(name)
        if panel_type is None or name in panel.demo:
            continue
        used = True
        if panel_type != wanted:
            message = (
                f"plays {name} as {wanted}, and the panel has {panel_type}; rename it or use that type"
            )
            yield Fault("demo_story", message, cause=f"listens {name}")
    if not used:
        some = list_names(sorted(name for _, name, _ in played))
        yield Fault("demo_story", f"the panel uses no name of the story; there is {some}")

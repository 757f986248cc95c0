"""The stories that a simulated robot can play, by the names of panel files."""

from collections.abc import Callable, Mapping
from typing import Final

from app.panel.demo import Story, StoryName
from app.panel.model import Panel
from app.panel.used import played_names
from app.ros.messages import Interfaces
from app.tools.simulator.story import PlayedStory

# Each is imported where it is played: a panel has one.


def _palletizing(names: Story, seed: int, panel: Panel, _: Interfaces) -> PlayedStory:
    from app.tools.simulator.palletizing import PlayedPalletizing

    return PlayedPalletizing(names, seed, panel.demo_heals_s)


def _driving(names: Story, seed: int, _: Panel, interfaces: Interfaces) -> PlayedStory:
    from app.tools.simulator.driving import PlayedDriving

    return PlayedDriving(names, seed, interfaces)


Play = Callable[[Story, int, Panel, Interfaces], PlayedStory]
PLAYED: Final[Mapping[StoryName, Play]] = {"palletizing": _palletizing, "driving": _driving}


def play(panel: Panel, seed: int, interfaces: Interfaces) -> PlayedStory | None:
    """The story of a panel, for the names that the panel uses; None without one."""
    if panel.demo_story is None or (names := played_names(panel)) is None:
        return None
    return PLAYED[panel.demo_story](names, seed, panel, interfaces)

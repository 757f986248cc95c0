"""The stories that a simulated robot can play, by the names of panel files."""

from collections.abc import Callable, Mapping
from typing import Final

from app.panel.demo import Story, StoryName
from app.panel.model import Panel
from app.panel.used import played_names
from app.ros.messages import Interfaces
from app.tools.simulator.driving import PlayedDriving
from app.tools.simulator.palletizing import PlayedPalletizing
from app.tools.simulator.story import PlayedStory

Play = Callable[[Story, int, Panel, Interfaces], PlayedStory]
PLAYED: Final[Mapping[StoryName, Play]] = {
    "palletizing": lambda names, seed, panel, _: PlayedPalletizing(names, seed, panel.demo_heals_s),
    "driving": lambda names, seed, _, interfaces: PlayedDriving(names, seed, interfaces),
}


def play(panel: Panel, seed: int, interfaces: Interfaces) -> PlayedStory | None:
    """The story of a panel, for the names that the panel uses; None without one."""
    if panel.demo_story is None or (names := played_names(panel)) is None:
        return None
    return PLAYED[panel.demo_story](names, seed, panel, interfaces)

"""What a key is for, and the colours that IEC 60204-1 leaves for it."""

from collections.abc import Mapping
from typing import Final, Literal

KeyRole = Literal["start", "stop", "reset", "hold", "toggle", "neutral"]
KeyColour = Literal["white", "grey", "black", "blue", "red", "yellow", "green"]

# Red on yellow belongs to emergency stops, which no screen has. Green is left out everywhere: what is
# normal has no colour.
COLOURS: Final[Mapping[KeyRole, tuple[KeyColour, ...]]] = {
    "start": ("white", "grey"),
    "stop": ("black", "grey"),
    "reset": ("blue", "white", "grey", "black"),
    "hold": ("white", "grey", "black"),
    "toggle": ("white", "grey", "black"),
    "neutral": ("white", "grey", "black"),
}
# A key of another role has the colour of the theme's keys.
OWN_COLOURS: Final[Mapping[KeyRole, KeyColour]] = {"start": "white", "stop": "black", "reset": "blue"}
# Signs that look like an icon: a key with such a label has the sign alone.
SIGNS: Final[Mapping[str, str]] = {
    "minus": "-−–",
    "plus": "+",
    "arrow-left": "←",
    "arrow-right": "→",
    "arrow-up": "↑",
    "arrow-down": "↓",
    "x": "×✕",
}
ICONS: Final[Mapping[KeyRole, str]] = {"start": "play", "stop": "square", "reset": "rotate-ccw"}

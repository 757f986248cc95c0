"""Ids, labels and pages from ROS names."""

import re
from collections.abc import Collection
from typing import Final

MAX_ID: Final = 58  # with a number behind it 64 at most
MAX_LABEL: Final = 40
GENERAL: Final = "robot"
# Names of bools that report a fault: true does not permit anything.
NEGATIVE: Final = re.compile(
    r"error|fault|fail|emergency|e_?stop|stopped|alarm|warn|blocked|collision|jam|abort|disable|inhibit",
    re.IGNORECASE,
)
POSITIVE: Final = re.compile(
    r"enable|permit|allow|permission|automatic|auto(?:_|$)|ready|interlock|release|safe|guard|operational",
    re.IGNORECASE,
)


def words_of(name: str) -> list[str]:
    """ "/arm/jointStates" → ["arm", "joint", "states"]."""
    parts = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name)
    return [word.lower() for word in re.split(r"[^A-Za-z0-9]+", parts) if word]


def id_of(name: str, taken: Collection[str]) -> str:
    """An id that is not taken, of a name or of several with a slash between them."""
    base = "_".join(words_of(name))[:MAX_ID] or "widget"
    base = base if base[0].isalpha() else f"n_{base}"
    return next(i for n in range(1, 10_000) if (i := base if n == 1 else f"{base}_{n}") not in taken)


def label_of(name: str) -> str:
    """A label of the last part of a name: "/arm/joint_states" → "Joint states"."""
    text = " ".join(words_of(name.rstrip("/").rpartition("/")[2])) or name
    return (text[0].upper() + text[1:])[:MAX_LABEL]


def place_of(name: str, nodes: Collection[str]) -> tuple[str, ...]:
    """The parts of the namespace of a topic or service, else of the node that it belongs to."""
    namespace = name.strip("/").split("/")[:-1]
    node = min(nodes, default="").strip("/").split("/")
    return tuple(filter(None, namespace or node)) or (GENERAL,)


def permits(name: str) -> bool:
    """Whether a bool of this name is likely to permit what the robot does."""
    return bool(POSITIVE.search(name)) and not NEGATIVE.search(name)

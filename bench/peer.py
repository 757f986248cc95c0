"""What is measured: a peer is a server with a page that shows a robot's topics and sends it commands.

Its page has a button that `/operation_enabled` (std_msgs/Bool) opens and locks, and that publishes the
text of `<input id="text">` on `/operation1` (std_msgs/String). Each of `Place.topics` (std_msgs/String)
shows as the text of an element with `data-topic="<name>"`.
"""

import time
import urllib.error
import urllib.request
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

POLLED_EVERY_S: Final = 0.005


@dataclass(frozen=True)
class Place:
    """Where a peer runs."""

    router: str  # the Zenoh locator to connect to
    domain: int  # the ROS domain, on loopback only
    folder: Path  # scratch, removed later
    topics: tuple[str, ...] = ()  # further topics to show: absolute ROS names
    buttons: int = 1  # more, where one takes a second press only after a pause


@dataclass(frozen=True)
class Bare:
    """How a client without a browser gets what the page gets: the values as they are on the wire must
    show the message's text. `port` is of the server that streams, 0 for that of the page."""

    kind: Literal["events", "websocket"]
    path: str  # with "{id}" for what is found in the page
    say: tuple[str | bytes, ...] = ()  # text and binary frames sent first
    port: int = 0
    found: str = ""  # a pattern whose group is the id that each client gets with a page of its own
    answers: tuple[str, str] | None = (
        None  # a text frame that the server sends, and what it wants for it
    )


@dataclass(frozen=True)
class Running:
    """A peer that answers HTTP."""

    url: str  # the page to open
    pids: tuple[int, ...]  # its server processes, for CPU and memory
    end: Callable[[], None]  # ends them all, leaves nothing behind
    bare: Bare | None = None  # None: no client but its page's script


@dataclass(frozen=True)
class Peer(ABC):
    """A peer; `robot` is how the robot's process reaches it.

    `shown` is the CSS selector of the element whose `disabled` follows /operation_enabled; `button` is
    that of the button (or of several like it, pressed in turn) that publishes on /operation1, "" for a
    page without one.
    """

    id: str
    title: str
    robot: Literal["zenoh", "ros"] = "zenoh"
    shown: str = "#publish"
    button: str = "#publish"

    def installed(self) -> bool:
        return True

    @abstractmethod
    def start(self, place: Place) -> Running:
        """Returns as soon as it answers HTTP."""


def until_answers(url: str, running: Callable[[], bool], within_s: float = 20.0) -> None:
    """Waits for a first 200; AssertionError where its process ends or its time is over."""
    opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
    end = time.monotonic() + within_s
    while time.monotonic() < end:
        try:
            with opener.open(url, timeout=1) as answer:
                if answer.status == 200:
                    return
        except (urllib.error.URLError, OSError):
            assert running(), f"what should answer at {url} has ended"
        time.sleep(POLLED_EVERY_S)
    raise AssertionError(f"no answer at {url} within {within_s} s")

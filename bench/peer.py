"""Peers, the measured systems: a server with a page that shows a robot's topics and sends it commands.

The page has a button that `/operation_enabled` (std_msgs/Bool) enables and disables, and that publishes
the text of `<input id="text">` on `/operation1` (std_msgs/String). An element with
`data-topic="<name>"` shows the text of each of `Place.topics` (std_msgs/String).
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
    """The environment of a peer."""

    router: str  # the Zenoh locator to connect to
    domain: int  # the ROS domain, on loopback only
    folder: Path  # scratch, removed later
    topics: tuple[str, ...] = ()  # further topics to show: absolute ROS names
    buttons: int = 1  # more than one if a button accepts a second press only after a pause


@dataclass(frozen=True)
class Bare:
    """How a client without a browser receives the page's data, in which the text of messages must be
    readable. `port` is that of the streaming server, 0 for that of the page."""

    kind: Literal["events", "websocket"]
    path: str  # "{id}" is replaced by the match of `found`
    say: tuple[str | bytes, ...] = ()  # text and binary frames sent first
    port: int = 0
    id_pattern: str = ""  # a pattern in the page, whose group is the client's id
    answers: tuple[str, str] | None = (
        None  # a text frame of the server, and the response that it requires
    )


@dataclass(frozen=True)
class Running:
    """A running peer, which responds to HTTP."""

    url: str  # the page to open
    pids: tuple[int, ...]  # its server processes, for CPU and memory
    end: Callable[[], None]  # ends all its processes, leaves nothing behind
    bare: Bare | None = None  # None: only the page's own script can connect


@dataclass(frozen=True)
class Peer(ABC):
    """A peer; `robot` is the transport by which the robot's process reaches it.

    `shown` is the CSS selector of the element whose attribute `disabled` shows /operation_enabled;
    `button` is that of the button (or several, pressed in turn) that publishes on /operation1, ""
    without one.
    """

    id: str
    title: str
    robot: Literal["zenoh", "ros", "rmw"] = "zenoh"
    shown: str = "#publish"
    button: str = "#publish"

    def installed(self) -> bool:
        return True

    @abstractmethod
    def start(self, place: Place) -> Running:
        """Starts the server; returns as soon as it responds to HTTP."""


def until_answers(url: str, running: Callable[[], bool], within_s: float = 20.0) -> None:
    """Waits for a response 200; AssertionError if the process ends, or at the timeout."""
    opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
    end = time.monotonic() + within_s
    while time.monotonic() < end:
        try:
            with opener.open(url, timeout=1) as answer:
                if answer.status == 200:
                    return
        except (urllib.error.URLError, OSError):
            assert running(), f"the server of {url} has ended"
        time.sleep(POLLED_EVERY_S)
    raise AssertionError(f"no answer at {url} within {within_s} s")

"""rosbridge-server-rs with a map: a page on roslib, and a ROS 2 node that publishes map and pose."""

import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from bench.peer import Place, Running
from bench.peers.parts import CACHE, started, with_page
from bench.peers.rosbridge_rs import PROGRAM, VENV, end_process, environment
from tests.support.parts import free_port

HERE: Final = Path(__file__).parent
SCRIPTS: Final = CACHE / "pages/rosbridge_map"
# It takes a cell for more than 128 bytes, and drops what is larger than its queue: by default (64 MiB)
# a map of 700 x 700.
QUEUE: Final = ("--write-queue-bytes", str(2**33))


class MapNode:
    """A ROS 2 node with a map of `side` x `side` cells and a pose; see `robot.py` for its orders."""

    def __init__(self, place: Place, side: int) -> None:
        own = {
            "ROS_DOMAIN_ID": str(place.domain),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "RMW_IMPLEMENTATION": "rmw_fastrtps_cpp",
            "PATH": "/usr/bin:/bin",
            "HOME": str(place.folder),
            "ROS_LOG_DIR": str(place.folder),
        }
        self._process = subprocess.Popen(
            [str(VENV / "bin/python"), str(HERE / "robot.py"), str(side)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=own,
            text=True,
        )
        self._said("ready")

    def order(self, order: str) -> None:
        """Sends an order, and waits until it is done."""
        assert self._process.stdin is not None
        self._process.stdin.write(f"{order}\n")
        self._process.stdin.flush()
        self._said(order)

    def _said(self, expected: str) -> None:
        assert self._process.stdout is not None
        assert self._process.stdout.readline() == f"{expected}\n", "the node has ended"

    def end(self) -> None:
        self._process.kill()
        self._process.communicate()


def is_installed() -> bool:
    return (VENV / "ready").exists() and SCRIPTS.exists()


@contextmanager
def served(place: Place, side: int) -> Iterator[tuple[MapNode, Running]]:
    """The node, and the server with its page."""
    port = free_port()
    command: list[str | Path] = [PROGRAM, "--bind", f"127.0.0.1:{port}", "--no-rosapi", *QUEUE]
    node = MapNode(place, side)
    try:
        process = started(command, environment(place), place.folder)
        running = with_page(
            process, port, HERE / "page.html", SCRIPTS, (), lambda: end_process(process)
        )
        try:
            yield node, running
        finally:
            running.end()
    finally:
        node.end()

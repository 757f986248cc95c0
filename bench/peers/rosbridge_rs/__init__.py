"""rosbridge-server-rs, a rosbridge in Rust, on ROS 2 jazzy, with a page on roslib."""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from bench.peer import Bare, Peer, Place, Running
from bench.peers.parts import CACHE, started, with_page
from tests.support.parts import Process, free_port

HERE: Final = Path(__file__).parent
VENV: Final = CACHE / "rosbridge"
PACKAGES: Final = VENV / "lib/python3.11/site-packages"
PROGRAM: Final = PACKAGES / "rosbridge_server_rs/rosbridge_server_rs_jazzy"
SCRIPTS: Final = CACHE / "pages/rosbridge_rs"


class RosbridgeRs(Peer):
    def installed(self) -> bool:
        return (VENV / "ready").exists() and SCRIPTS.exists()

    def start(self, place: Place) -> Running:
        port = free_port()
        # The page does not need rosapi, whose messages are in no registry.
        command: list[str | Path] = [PROGRAM, "--bind", f"127.0.0.1:{port}", "--no-rosapi"]
        process = started(command, environment(place), place.folder)
        bare = Bare("websocket", "/", tuple(subscriptions(place.topics)), port)
        page = HERE / "page.html"
        return with_page(process, port, page, SCRIPTS, place.topics, lambda: end_process(process), bare)


def end_process(process: Process) -> None:
    """Ends the process, and removes the files of Fast DDS that the next one on the domain would
    find."""
    maps = Path(f"/proc/{process.pid}/maps").read_text() if process.running else ""
    process.end()
    for path in set(re.findall(r"/dev/shm/(?:sem\.)?fastrtps_\S+", maps)):
        Path(path).unlink(missing_ok=True)


def subscriptions(topics: tuple[str, ...]) -> Iterator[str]:
    """The messages that roslib sends to the server."""
    for topic in topics:
        yield json.dumps({"op": "subscribe", "topic": topic, "type": "std_msgs/msg/String"})


def environment(place: Place) -> dict[str, str]:
    """The environment after sourcing ROS 2's setup.bash; `shims`: see the Makefile."""
    libraries = [VENV / "shims", VENV / "lib", *sorted(PACKAGES.glob("ros_*.libs"))]
    return {
        "ROS_DISTRO": "jazzy",
        "ROS_VERSION": "2",
        "ROS_DOMAIN_ID": str(place.domain),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "RMW_IMPLEMENTATION": "rmw_fastrtps_cpp",
        "AMENT_PREFIX_PATH": str(VENV),
        "LD_LIBRARY_PATH": ":".join(str(path) for path in libraries),
        "HOME": str(place.folder),
    }

"""A robot on rmw_zenoh for the tests: its router and its nodes, each a process, with the same commands
as the bridge and the rclpy nodes of `tests/support/parts.py`."""

import json
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from tests.support.parts import ORDERS, ROOT, Bridge, Process, RosNode, until
from tests.support.processes.commanded import Commanded

OWN_ORDERS = {**ORDERS, "hold": ("token",)}


class Router(Bridge):
    """A Zenoh router in place of the bridge."""

    def __init__(self, domain: int = 0) -> None:
        super().__init__(domain)

    def start(self) -> None:
        module = "tests.support.processes.rmw_router"
        place = str(self._file or self.endpoint)
        self._process = Process([sys.executable, "-m", module, place], {}, cwd=str(ROOT))
        process = self._process
        until(lambda: "running" in process.text or not process.running, "the router runs")
        assert process.running, process.text


def router_without_admin_space(folder: Path) -> Router:
    """A router as it is without a configuration of rmw_zenoh's; it has not started."""
    mine, file = Router(), folder / "router.json5"
    scouting = "scouting: { multicast: { enabled: false } }"
    file.write_text(f'{{ mode: "router", listen: {{ endpoints: ["{mine.endpoint}"] }}, {scouting} }}')
    mine.configure(file)
    return mine


def router_file(folder: Path, name: str, listen: str, connect: Sequence[str] = ()) -> Path:
    """The configuration of a plant's router, which notices after 2 s that another one is silent."""
    file = folder / f"{name}.json5"
    config = {
        "mode": "router",
        "listen": {"endpoints": [listen]},
        "connect": {"endpoints": list(connect)},
        "scouting": {"multicast": {"enabled": False}},
        "transport": {"link": {"tx": {"lease": 2000, "keep_alive": 4}}},
    }
    file.write_text(json.dumps(config))
    return file


class LinkedRouters:
    """Two routers that are connected to each other, from `start` to `end`."""

    def __init__(self, folder: Path) -> None:
        self.routers = [Router(), Router()]
        for number, router in enumerate(self.routers):
            other = self.routers[1 - number].endpoint
            router.configure(router_file(folder, f"router{number}", router.endpoint, [other]))

    @property
    def endpoints(self) -> list[str]:
        return [router.endpoint for router in self.routers]

    def start(self) -> None:
        for router in self.routers:
            router.start()

    def end(self) -> None:
        for router in self.routers:
            router.end()


class RmwNode(RosNode):
    """A node on rmw_zenoh; see `tests/support/processes/rmw_node.py` for its commands."""

    def __init__(self, router: Bridge, name: str = "system_controller") -> None:
        module = "tests.support.processes.rmw_node"
        command = [sys.executable, "-m", module, name, router.endpoint, str(router.domain)]
        Commanded.__init__(self, command, {}, cwd=ROOT)

    def start(self) -> None:
        Commanded.start(self)

    def __getattr__(self, name: str) -> Callable[..., Any]:
        def do(*arguments: Any, **named: Any) -> Any:
            return self(name, **dict(zip(OWN_ORDERS.get(name, ()), arguments, strict=False)), **named)

        return do

    def kill(self) -> None:
        self._process.kill()
        self._process.wait()
        self.end()

    def end(self) -> None:
        if self._process.poll() is None:
            assert self.broken() == [], "what the panel sent would have ended the node"
        super().end()

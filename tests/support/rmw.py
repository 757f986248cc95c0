"""A robot on rmw_zenoh for the tests: its router and its nodes, each a process, with the same commands
as the bridge and the rclpy nodes of `tests/support/parts.py`."""

import json
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

import zenoh

from app.tools.cell_config.rmw_zenoh_router import FOR_NODES
from app.tools.cli.command import main as command
from tests.support.parts import ORDERS, ROOT, Bridge, Process, RosNode, until
from tests.support.places import ZENOHD
from tests.support.processes.commanded import Commanded

LISTENS: Final = "Listener added"  # in the log, once for each endpoint
LOG: Final = "RUST_LOG=warn,zenoh::net::runtime::orchestrator=debug"
OWN_ORDERS = {**ORDERS, "hold": ("token",)}


class Router(Bridge):
    """zenohd in place of the bridge, as users run it. A test that starts it takes `zenohd`, or another
    fixture of a real part."""

    def __init__(self, domain: int = 0) -> None:
        super().__init__(domain)

    def start(self) -> None:
        self._process = process = Process(self._command(), {}, cwd=str(ROOT))
        ends = len(self._ends())
        until(lambda: process.text.count(LISTENS) >= ends or not process.running, "the router listens")
        assert process.running, process.text

    def _ends(self) -> Sequence[str]:
        if self._file is None:
            return [self.endpoint]
        config = zenoh.Config.from_file(self._file)
        return [*json.loads(config.get_json("listen/endpoints"))]

    def _command(self) -> Sequence[str]:
        return ("setpriv", "--pdeathsig", "KILL", *zenohd(*self._configuration()))

    def _configuration(self) -> list[str]:
        if self._file is not None:
            return ["-c", str(self._file)]
        return ["--listen", self.endpoint, "--no-multicast-scouting"]


def zenohd(*options: str) -> Sequence[str]:
    """The command of a router that writes its log to stderr, without the panel's `ZENOH_RUNTIME`, which
    its tests have inherited."""
    environment = ("-u", "ZENOH_RUNTIME", "NO_COLOR=1", LOG)
    return ("env", *environment, "sh", "-c", 'exec "$0" "$@" >&2', str(ZENOHD), *options)


class SessionRouter(Router):
    """A session of eclipse-zenoh in router mode, for the tests of `make test`: they need no Rust, and
    there is no zenohd without. Its routing and links are those of zenohd, from the same source."""

    def _command(self) -> Sequence[str]:
        module = "tests.support.processes.session_router"
        return (sys.executable, "-m", module, str(self._file or self.endpoint))


def router_without_admin_space(folder: Path) -> SessionRouter:
    """A router as it is without a configuration of rmw_zenoh's; it has not started. zenohd has an admin
    space in any case."""
    mine, file = SessionRouter(), folder / "router.json5"
    scouting = "scouting: { multicast: { enabled: false } }"
    file.write_text(f'{{ mode: "router", listen: {{ endpoints: ["{mine.endpoint}"] }}, {scouting} }}')
    mine.configure(file)
    return mine


def configured_router(panel: Path, file: Path, door: str, *options: str) -> Router:
    """A router with what `operator-panel router-config` writes: nodes come to its endpoint, the panel
    to `door`. It has not started."""
    mine = Router()
    assert command(["router-config", str(panel), "--listen", door, *options, "-o", str(file)]) == 0
    file.write_text(file.read_text().replace(FOR_NODES, mine.endpoint))
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

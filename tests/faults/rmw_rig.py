"""The test rig without a bridge: a Zenoh router, two nodes on rmw_zenoh, and a kiosk server."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from tests.faults.rig import PANEL, Rig, listening, permitting
from tests.support.parts import RosNode, Server, free_port
from tests.support.rmw import RmwNode, configured_router

RMW_PANEL: Final = f'dialect = "rmw_zenoh"\n{PANEL}'


class RmwRig(Rig):
    """Router and nodes; the router is in the place of the bridge, as `router-config` configures it. The
    panel comes to `endpoint`: a socket on the robot's machine, or a port at `ip`."""

    def __init__(self, ip: str = "") -> None:
        self._folder = TemporaryDirectory(dir="/tmp", prefix="panel-")  # a socket's path must be short
        folder = Path(self._folder.name)
        (folder / "cell.toml").write_text(RMW_PANEL)
        self._door = f"tcp/{ip}:{free_port()}" if ip else f"unixsock-stream/{folder}/panel.sock"
        self.bridge = configured_router(folder / "cell.toml", folder / "router.json5", self._door)
        self.bridge.start()
        self.ears: RosNode = RmwNode(self.bridge, "ears")
        listening(self.ears)
        self.robot: RosNode = self.another_robot()

    @property
    def endpoint(self) -> str:
        return self._door

    def another_robot(self) -> RosNode:
        """A node that permits."""
        node = RmwNode(self.bridge, "robot")
        permitting(node)
        return node

    @contextmanager
    def serving(
        self, folder: Path, endpoint: str = "", panel: str = RMW_PANEL, **environment: str
    ) -> Iterator[Server]:
        with super().serving(folder, endpoint, panel, **environment) as server:
            yield server

    def end(self) -> None:
        super().end()
        self._folder.cleanup()

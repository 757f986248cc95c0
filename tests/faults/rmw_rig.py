"""The test rig without a bridge: a Zenoh router, two nodes on rmw_zenoh, and a kiosk server."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from tests.faults.rig import PANEL, Rig, listening, permitting
from tests.support.parts import RosNode, Server
from tests.support.rmw import RmwNode, Router

RMW_PANEL: Final = f'dialect = "rmw_zenoh"\n{PANEL}'


class RmwRig(Rig):
    """Router and nodes; the router is in the place of the bridge."""

    def __init__(self, ip: str = "127.0.0.1") -> None:
        self.bridge = Router()
        self.bridge.endpoint = f"tcp/{ip}:{self.bridge.port}"
        self.bridge.start()
        self.ears: RosNode = RmwNode(self.bridge, "ears")
        listening(self.ears)
        self.robot: RosNode = self.another_robot()

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

"""This panel on both dialects: over the real bridge from a ROS 2 node, and over a router from a node on
rmw_zenoh."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

from bench.kiosk import Kiosk
from bench.peer import Peer
from bench.phases import latency
from bench.phases.cost import single
from bench.rig import Rig

BRIDGE: Final = replace(
    Kiosk(), id="kiosk-bridge", title="over the bridge", robot="ros", dialect="bridge"
)
RMW: Final = replace(Kiosk(), id="kiosk-rmw", title="on rmw_zenoh", robot="rmw", dialect="rmw_zenoh")


def dialect(rig: Rig, peer: Peer, routers: Mapping[str, str]) -> dict[str, float]:
    """One round of a dialect; `routers` has the locator of each by the peer's id."""
    router = routers[peer.id]
    down = latency.down(rig, peer, router=router)
    up = latency.up(rig, peer, router)
    return (
        {f"down_{name}": figure for name, figure in down.items()}
        | {f"up_{name}": figure for name, figure in up.items()}
        | single(rig, peer, router)
    )

"""What the kiosk is measured against, each written as its documentation and a sensible user would."""

from typing import Final

from bench.peer import Peer
from bench.peers.floor import Floor
from bench.peers.nicegui_zenoh import NiceGui
from bench.peers.plain import Plain
from bench.peers.rosbridge_rs import RosbridgeRs
from bench.peers.zenoh_ts import ZenohTs

PEERS: Final[tuple[Peer, ...]] = (
    Floor(),
    Plain("plain", "plain way, press by fetch", ""),
    Plain("plain-ws", "plain way, press by WebSocket", "?websocket"),
    RosbridgeRs(),
    NiceGui(),
    ZenohTs(),
)

"""The peers that this panel is compared with, each written as its documentation recommends."""

from typing import Final

from bench.peer import Peer
from bench.peers.floor import Floor
from bench.peers.nicegui_zenoh import NiceGui
from bench.peers.plain import Plain
from bench.peers.rosbridge_rs import RosbridgeRs
from bench.peers.zenoh_ts import ZenohTs

PEERS: Final[tuple[Peer, ...]] = (
    Floor("floor", "raw event stream (floor)", button=""),
    Plain("plain", "plain way, press by fetch"),
    Plain("plain-ws", "plain way, press by WebSocket", query="?websocket"),
    RosbridgeRs("rosbridge-rs", "rosbridge-server-rs + roslib", robot="ros"),
    NiceGui("nicegui", "NiceGUI + Zenoh", shown="button.publish", button="button.publish"),
    ZenohTs("zenoh-ts", "zenoh-ts + remote-api (Rust router)"),
)

"""What the kiosk is measured against, each written as its documentation and a sensible user would."""

from typing import Final

from bench.peer import Peer
from bench.peers.floor import Floor
from bench.peers.plain import Plain

PEERS: Final[tuple[Peer, ...]] = (
    Floor(),
    Plain("plain", "plain way, press by fetch", ""),
    Plain("plain-ws", "plain way, press by WebSocket", "?websocket"),
)

"""NiceGUI with a Zenoh subscriber: a page of a Python UI framework."""

from pathlib import Path
from typing import Final

from bench.peer import Bare, Peer, Place, Running
from bench.peers.parts import CACHE, serving
from tests.support.parts import free_port

VENV: Final = CACHE / "nicegui"

# Socket.IO without a library: the page's handshake is in the query, "40" connects, "3" answers a "2".
SOCKET: Final = (
    "/_nicegui_ws/socket.io/?client_id={id}&next_message_id=0&implicit_handshake=true"
    "&document_id=bare&tab_id={id}&EIO=4&transport=websocket"
)
BARE: Final = Bare(
    "websocket", SOCKET, say=("40",), id_pattern=r"'client_id': '([0-9a-f-]+)'", answers=("2", "3")
)


class NiceGui(Peer):
    def installed(self) -> bool:
        return (VENV / "ready").exists()

    def start(self, place: Place) -> Running:
        port = free_port()
        app = Path(__file__).with_name("app.py")
        command: list[str | Path] = [VENV / "bin/python", app, str(port), place.router, *place.topics]
        return serving(command, {}, place, f"http://127.0.0.1:{port}/", BARE)

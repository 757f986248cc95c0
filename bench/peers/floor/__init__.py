"""The floor: a raw event stream, the minimum for showing a robot's topic in a browser."""

from pathlib import Path

from bench.peer import Peer, Place, Running
from bench.peers.parts import serving, uvicorn
from tests.support.parts import free_port


class Floor(Peer):
    def start(self, place: Place) -> Running:
        port = free_port()
        command = uvicorn(Path(__file__).parent, port)
        return serving(
            command, {"BENCH_ROUTER": place.router}, place, f"http://127.0.0.1:{port}/", None
        )

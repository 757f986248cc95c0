"""NiceGUI with a Zenoh subscriber: a page of a Python UI framework."""

from pathlib import Path
from typing import Final

from bench.peer import Peer, Place, Running
from bench.peers.parts import CACHE, serving
from tests.parts import free_port

VENV: Final = CACHE / "nicegui"


class NiceGui(Peer):
    def installed(self) -> bool:
        return (VENV / "ready").exists()

    def start(self, place: Place) -> Running:
        port = free_port()
        app = Path(__file__).with_name("app.py")
        command: list[str | Path] = [VENV / "bin/python", app, str(port), place.router, *place.topics]
        return serving(command, {}, place, f"http://127.0.0.1:{port}/", None)

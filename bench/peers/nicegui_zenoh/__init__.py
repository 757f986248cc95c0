"""NiceGUI with a Zenoh subscriber: a page of a Python UI framework."""

from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

from bench.peer import Place, Running
from bench.peers.parts import CACHE, serving
from tests.parts import free_port

VENV: Final = CACHE / "nicegui"


@dataclass(frozen=True)
class NiceGui:
    id: str = "nicegui"
    title: str = "NiceGUI + Zenoh"
    robot: Literal["zenoh", "ros"] = "zenoh"
    shown: str = "button.publish"
    button: str = "button.publish"

    def installed(self) -> bool:
        return (VENV / "ready").exists()

    def start(self, place: Place) -> Running:
        port = free_port()
        app = Path(__file__).with_name("app.py")
        command: list[str | Path] = [VENV / "bin/python", app, str(port), place.router, *place.topics]
        return serving(command, {}, place, f"http://127.0.0.1:{port}/", None)

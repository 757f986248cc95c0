"""The floor: a raw event stream. Nothing that shows a robot's topic in a browser does less."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from bench.peer import Place, Running
from bench.peers.parts import serving, uvicorn
from tests.parts import free_port


@dataclass(frozen=True)
class Floor:
    id: str = "floor"
    title: str = "raw event stream (floor)"
    robot: Literal["zenoh", "ros"] = "zenoh"
    shown: str = "#publish"
    button: str = ""

    def installed(self) -> bool:
        return True

    def start(self, place: Place) -> Running:
        port = free_port()
        command = uvicorn(Path(__file__).parent, port)
        return serving(
            command, {"BENCH_ROUTER": place.router}, place, f"http://127.0.0.1:{port}/", None
        )

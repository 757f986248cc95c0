"""zenoh-ts: Zenoh in the browser, by way of a router with the remote-api plugin."""

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

from bench.peer import Bare, Peer, Place, Running
from bench.peers.parts import CACHE, ending, started, with_page
from tests.support.parts import free_port

HERE: Final = Path(__file__).parent
ROUTER: Final = CACHE / "router/release/bench-router"
SCRIPTS: Final = CACHE / "pages/zenoh_ts"


class ZenohTs(Peer):
    def installed(self) -> bool:
        return ROUTER.exists() and SCRIPTS.exists()

    def start(self, place: Place) -> Running:
        port = free_port()
        config = place.folder / "router.json5"
        config.write_text(json.dumps(configuration(place.router, port)))
        process = started([ROUTER, config], {}, place.folder)
        page = HERE / "page.html"
        bare = Bare("websocket", "/", tuple(subscriptions(place.topics)), port)
        return with_page(process, port, page, SCRIPTS, place.topics, ending(process.end), bare)


def subscriptions(topics: Sequence[str]) -> Iterator[bytes]:
    """The messages that the page's library sends: a session, then a subscriber per topic (short
    names)."""
    yield b"\x99" + bytes(4)
    for number, topic in enumerate(topics, 1):
        key = topic.removeprefix("/").encode()
        numbers = number.to_bytes(4, "little") * 2
        yield b"\x82" + numbers + bytes([len(key)]) + key + b"\x02"


def configuration(robot: str, port: int) -> dict[str, object]:
    """The configuration of a router between one robot and browsers."""
    return {
        "mode": "router",
        "connect": {"endpoints": [robot]},
        "listen": {"endpoints": []},
        "scouting": {"multicast": {"enabled": False}},
        "plugins_loading": {"enabled": True},
        "plugins": {"remote_api": {"websocket_port": f"127.0.0.1:{port}"}},
    }

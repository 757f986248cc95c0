"""The plain way: forty lines of Starlette between Zenoh and an event stream."""

from dataclasses import dataclass
from pathlib import Path

from bench.peer import Bare, Peer, Place, Running
from bench.peers.parts import serving, uvicorn, with_topics
from tests.support.parts import free_port

HERE = Path(__file__).parent


@dataclass(frozen=True)
class Plain(Peer):
    """The plain way; `query` of the page's URL selects how it presses."""

    query: str = ""

    def start(self, place: Place) -> Running:
        page = place.folder / "page.html"
        page.write_text(with_topics(HERE / "page.html", place.topics))
        env = {
            "BENCH_ROUTER": place.router,
            "BENCH_TOPICS": " ".join(place.topics),
            "BENCH_PAGE": str(page),
        }
        port = free_port()
        url = f"http://127.0.0.1:{port}/{self.query}"
        return serving(uvicorn(HERE, port), env, place, url, Bare("events", "/events"))

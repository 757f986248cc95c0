"""Start times: process → first response → ready; request → first page → robot's state shown; bytes."""

import time
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from bench.peer import Peer, Running, until_answers
from bench.rig import Rig, scratch

SAID_EVERY_S: Final = 0.02


def start(rig: Rig, peer: Peer) -> dict[str, Any]:
    """The figures of a peer's first and second start in a folder; the second finds its caches and data.
    The page is loaded with an empty browser cache."""
    with scratch(peer) as folder:
        with _started(rig, peer, folder) as (_, first):
            figures: dict[str, Any] = {f"first_{name}": seconds for name, seconds in first.items()}
        with _started(rig, peer, folder) as (server, second):
            figures |= second
            rig.robot("repeat", way=peer.robot, values=[True], period_s=SAID_EVERY_S)
            time.sleep(2 * SAID_EVERY_S)
            figures["html_ms"] = 1000 * _spent(lambda: _get(server.url))
            figures["shown_ms"], figures["bytes"] = rig.chromium.load(server.url, peer.shown)
        return figures


@contextmanager
def _started(rig: Rig, peer: Peer, folder: Path) -> Iterator[tuple[Running, dict[str, float]]]:
    began = time.monotonic()
    with rig.running(peer, folder=folder) as server:
        figures = {"answers_s": rig.started_s}
        if peer.id == "kiosk":  # the other peers have no readiness check
            until_answers(server.url + "readyz", lambda: True)
            figures["ready_s"] = time.monotonic() - began
        yield server, figures


def _spent(do: Callable[[], object]) -> float:
    began = time.monotonic()
    do()
    return time.monotonic() - began


def _get(url: str) -> None:
    opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
    with opener.open(url, timeout=10) as answer:
        answer.read()

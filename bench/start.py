"""Start: process → first answer and → ready; request → first page → the robot's state shows; bytes."""

import time
import urllib.request
from collections.abc import Callable
from typing import Any, Final

from bench.peer import Peer, until_answers
from bench.rig import Rig

SAID_EVERY_S: Final = 0.02


def start(rig: Rig, peer: Peer) -> dict[str, Any]:
    """One start of one peer. Each load is of a browser that does not know the page."""
    began = time.monotonic()
    with rig.running(peer) as server:
        found: dict[str, Any] = {"answers_s": rig.started_s}
        if peer.id == "kiosk":  # the others do not tell whether commands can reach the robot
            until_answers(server.url + "readyz", lambda: True)
            found["ready_s"] = time.monotonic() - began
        rig.robot("repeat", way=peer.robot, values=[True], period_s=SAID_EVERY_S)
        time.sleep(2 * SAID_EVERY_S)
        found["html_ms"] = 1000 * _spent(lambda: _get(server.url))
        found["shown_ms"], found["bytes"] = rig.chromium.load(server.url, peer.shown)
        return found


def _spent(do: Callable[[], object]) -> float:
    began = time.monotonic()
    do()
    return time.monotonic() - began


def _get(url: str) -> None:
    opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
    with opener.open(url, timeout=10) as answer:
        answer.read()

"""A server that is killed at any moment loses nothing of the operator's log."""

import random
import signal
import threading
from collections.abc import Callable
from pathlib import Path

import httpx
import pytest

from app.records import Entry, Filter
from app.records.database import rows
from app.records.verify import verify
from app.system.texts import say
from tests.support.form import several
from tests.support.parts import Bridge, RosNode, Server, has_heard, http_client, live, until

pytestmark = [pytest.mark.long("fault"), pytest.mark.promise("log")]

KILLS = several(5, 60)
CLIENTS = 3
LONGEST_LIFE_S = 0.5
TOO_MANY = 429


def all_entries(folder: Path) -> list[Entry]:
    return [row.entry for row in rows(folder, Filter(every=True), None, 1_000_000)]


def press_on(url: str, client: int, receipts: dict[str, str]) -> None:
    """Presses, one after another, until the server is gone; keeps the answers."""
    with http_client(url, 10) as http:
        for number in range(100_000):
            press_id = f"{http.base_url.port}-{client}-{number}"
            press = {"id": press_id, "inputs": {"message": press_id}}
            try:
                answer = http.post("/widgets/operation", json=press)
            except httpx.TransportError:
                return
            if answer.status_code != TOO_MANY:  # what is over the limit is counted, not logged
                receipts[press_id] = answer.json()["outcome"]


def killed_under_presses(
    server: Server, node: RosNode, chance: random.Random, receipts: dict[str, str]
) -> None:
    """Kills it some time after its first press has arrived and its first receipt has come."""
    until(server.ready, "ready")
    heard, received = len(node.heard("/operation")), len(receipts)
    clients = [
        threading.Thread(target=press_on, args=(server.url, client, receipts))
        for client in range(CLIENTS)
    ]
    for client in clients:
        client.start()
    try:
        until(lambda: has_heard(node, "/operation", heard + 1), "a press arrives")
        until(lambda: len(receipts) > received, "a receipt comes")
        threading.Event().wait(chance.uniform(0, LONGEST_LIFE_S))
    finally:
        server.end(signal.SIGKILL)
    for client in clients:
        client.join()


def test_kills_during_presses_lose_no_entry(
    bridge: Bridge, node: RosNode, tmp_path: Path, servers: Callable[[Server], Server]
) -> None:
    seed = random.randrange(10**9)
    chance = random.Random(seed)
    receipts: dict[str, str] = {}
    before = len(node.heard("/operation"))
    data = tmp_path / "data"
    for _ in range(KILLS):
        server = live(bridge.endpoint, tmp_path, KIOSK_DATA=str(data))
        killed_under_presses(server, node, chance, receipts)
    last = servers(live(bridge.endpoint, tmp_path, KIOSK_DATA=str(data)))
    verified = verify(data)
    assert verified.fault == "", seed
    entries = all_entries(data)
    assert verified.count == len(entries)
    pressed = {entry.press: entry for entry in entries if entry.kind == "pressed"}
    closed = {entry.press: entry for entry in entries if entry.kind == "closed"}
    assert len(receipts) >= KILLS
    assert {p: closed[p].outcome for p in receipts} == receipts, seed
    heard = node.heard_data("/operation")[before:]
    assert len(heard) >= KILLS
    assert [text for text in heard if text not in pressed] == [], seed
    assert pressed.keys() == closed.keys(), seed
    cut = {p for p, entry in closed.items() if entry.reason == say("press_unknown_server_ended")}
    assert cut.isdisjoint(receipts), seed
    until(last.ready, "ready")
    assert last.press("operation", "after all").status_code == 200

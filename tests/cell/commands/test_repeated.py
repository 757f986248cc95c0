"""The same press id is the same press over a restart: the receipt is what the operator's log knows."""

import asyncio
import signal
import sqlite3
import threading
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import httpx
import pytest

from app.records import Entry, Limits, OperatorLog, Origin, Repeated, new_entry, same_values
from app.records.database import NAME
from app.records.entry import as_json
from app.records.store import Store
from app.records.verify import verify
from tests.bridge import test_calls_on_bridge
from tests.support import cyclone
from tests.support.cyclone import CycloneRobot
from tests.support.parts import Bridge, Server, until
from tests.support.servers import live_server

pytestmark = pytest.mark.promise("receipt")

cyclone_bridge = cyclone.cyclone_bridge
client = cyclone.client
cyclone_robots = cyclone.cyclone_robots
robot = cyclone.robot

PANEL = test_calls_on_bridge.PANEL.replace("timeout_s = 1.0", "timeout_s = 30.0")  # of `slow`
TEXT = "std_msgs/msg/String"
SLOW = {"id": "slow-1", "inputs": {}}

Start = Callable[[], Server]


@pytest.fixture
def start(
    cyclone_bridge: Bridge, robot: CycloneRobot, tmp_path: Path, servers: Callable[[Server], Server]
) -> Start:
    """Starts a server on the data of the one before."""

    def started() -> Server:
        data = str(tmp_path / "data")
        kiosk = servers(live_server(cyclone_bridge, tmp_path, PANEL, KIOSK_DATA=data))
        until(lambda: kiosk.widget("enable")["enabled"], "the service is offered")
        return kiosk

    return started


def press(kiosk: Server, widget: str, press_id: str, **inputs: Any) -> httpx.Response:
    return kiosk.http.post(f"/widgets/{widget}", json={"id": press_id, "inputs": inputs})


def receipt_of(answer: httpx.Response) -> tuple[int, str, str, str]:
    receipt = answer.json()
    return answer.status_code, receipt["id"], receipt["outcome"], receipt["reason"]


def test_a_press_that_comes_again_after_a_kill_is_sent_once(
    start: Start, robot: CycloneRobot, tmp_path: Path
) -> None:
    robot.subscribe(topic="/said", type=TEXT)
    kiosk = start()
    until(lambda: robot.publishers(topic="/said"), "its reader has found the bridge's writer")
    said = receipt_of(press(kiosk, "say", "say-1", words="once"))
    assert said[2] == "published"
    called = receipt_of(press(kiosk, "enable", "enable-1"))
    robot.answer_set_enabled(success=False, message="no \u202e")
    refused = receipt_of(press(kiosk, "enable", "enable-2"))
    unsendable = receipt_of(press(kiosk, "say", "say-2", words=7))
    locked = receipt_of(press(kiosk, "nowhere", "nowhere-1"))
    assert [called[2], refused[2], unsendable[0], locked[0]] == ["succeeded", "rejected", 422, 503]
    kiosk.end(signal.SIGKILL)
    kiosk = start()
    until(lambda: robot.publishers(topic="/said"), "its reader has found the bridge's writer")
    for _ in range(2):
        assert receipt_of(press(kiosk, "say", "say-1", words="once")) == said
        assert receipt_of(press(kiosk, "enable", "enable-1")) == called
        assert receipt_of(press(kiosk, "enable", "enable-2")) == refused
        assert receipt_of(press(kiosk, "say", "say-2", words=7)) == unsendable
        assert receipt_of(press(kiosk, "nowhere", "nowhere-1")) == locked
    assert receipt_of(press(kiosk, "say", "say-3", words="last"))[2] == "published"
    until(lambda: len(robot.heard(topic="/said")) >= 2, "the last one is heard")
    assert [message["data"] for message in robot.heard(topic="/said")] == ["once", "last"]
    assert len(robot.requests("/set_enabled")) == 2
    assert verify(tmp_path / "data").fault == ""


def test_the_id_of_another_press_is_refused_after_a_kill_too(start: Start, robot: CycloneRobot) -> None:
    kiosk = start()
    assert press(kiosk, "say", "say-1", words="this").json()["outcome"] != "refused"
    kiosk.end(signal.SIGKILL)
    kiosk = start()
    for answer in (
        press(kiosk, "say", "say-1", words="that"),
        press(kiosk, "enable", "say-1", words="this"),
        press(kiosk, "say", "say-1"),
    ):
        assert (answer.status_code, answer.json()["outcome"]) == (422, "refused")
        assert "the press id say-1 was already used" in answer.json()["reason"]
        assert answer.json()["id"] != "say-1"
    assert robot.requests("/set_enabled") == []


def test_a_press_that_was_cut_off_is_unknown_and_not_sent_again(
    start: Start, robot: CycloneRobot
) -> None:
    robot.answer_slow(seconds=None)
    kiosk = start()

    def pressed() -> None:
        with pytest.raises(httpx.TransportError):
            httpx.post(f"{kiosk.url}/widgets/slow", json=SLOW, trust_env=False)

    waiting = threading.Thread(target=pressed)
    waiting.start()
    until(lambda: robot.requests("/slow"), "the robot is at it")
    kiosk.end(signal.SIGKILL)
    waiting.join()
    kiosk = start()
    until(lambda: kiosk.widget("slow")["enabled"], "it could be sent")
    answer = kiosk.http.post("/widgets/slow", json=SLOW)
    assert (answer.status_code, answer.json()["outcome"]) == (200, "unknown")
    assert answer.json()["reason"] == "the panel server ended before the result was known"
    with kiosk.socket() as socket:
        assert socket.press(widget="slow", **SLOW).json()["outcome"] == "unknown"
    form = "_id=f1&words=a"
    kind = {"content-type": "application/x-www-form-urlencoded"}
    page = kiosk.http.post("/widgets/enable", content=form, headers=kind).headers["location"]
    kiosk.end(signal.SIGKILL)
    kiosk = start()
    assert kiosk.http.post("/widgets/enable", content=form, headers=kind).headers["location"] == page
    assert "Done at" in kiosk.http.get(page).text
    assert (len(robot.requests("/slow")), len(robot.requests("/set_enabled"))) == (1, 1)


def test_receipt_has_the_outcome_that_is_known_later(start: Start, robot: CycloneRobot) -> None:
    robot.fibonacci(step_s=30)
    kiosk = start()
    assert press(kiosk, "count", "goal-1").json()["outcome"] == "accepted"
    kiosk.end(signal.SIGKILL)
    kiosk = start()
    until(lambda: kiosk.widget("count")["goal"] == "EXECUTING", "it is found again")
    assert press(kiosk, "count", "goal-1").json()["outcome"] in ("accepted", "unknown")
    robot.cancel()
    until(lambda: kiosk.widget("count")["outcome"] == "canceled", "its end is known")
    until(lambda: press(kiosk, "count", "goal-1").json()["outcome"] == "canceled", "and logged")
    assert len(robot.goals()) == 1


# Without a server.


def pressed(number: int, robot: str = "") -> Entry:
    origin = Origin(address="10.0.0.7")
    return new_entry("pressed", origin, {"n": number}, press=f"p{number}", action="press", robot=robot)


def test_operators_log_finds_a_press_by_its_id(tmp_path: Path) -> None:
    async def work() -> None:
        for again in (False, True):
            log = OperatorLog(tmp_path, Limits())
            await log.start()
            if again:
                with pytest.raises(Repeated) as known:
                    await log.pressed(pressed(1))
                assert known.value.last_entry
                assert (known.value.press.seq, known.value.last_entry.outcome) == (2, "unknown")
                assert await log.pressed(pressed(1, robot="r2")) is not None
            else:
                assert await log.pressed(pressed(1)) is not None
            await log.stop()

    asyncio.run(work())
    assert verify(tmp_path).fault == ""


def plan(folder: Path) -> str:
    with closing(sqlite3.connect(folder / NAME)) as db:
        query = "SELECT seq FROM entry WHERE press = 'x' AND press <> '' ORDER BY seq"
        return str(db.execute(f"EXPLAIN QUERY PLAN {query}").fetchall())


def test_a_press_is_looked_up_by_an_index_in_older_files_too(tmp_path: Path) -> None:
    store = Store(tmp_path, "boot1")
    for number in range(100):
        store.append([pressed(number)])
    store.close()
    assert "entry_press" in plan(tmp_path)
    with sqlite3.connect(tmp_path / NAME) as db:
        db.execute("DROP INDEX entry_press")
    db.close()
    store = Store(tmp_path, "boot2")
    assert [entry.seq for entry in store.entries_of_press(pressed(7))] == [8]
    assert store.entries_of_press(pressed(1000)) == []
    store.close()
    assert "entry_press" in plan(tmp_path)
    assert verify(tmp_path).fault == ""


def test_values_are_compared_as_far_as_an_entry_has_them() -> None:
    assert same_values(as_json({"a": 1, "b": True}), {"b": True, "a": 1})
    assert not same_values(as_json({"a": 1}), {"a": True})
    assert not same_values(as_json({"a": 1}), {})
    long = {"text": "x" * 5000}
    assert same_values(as_json(long), long)
    assert not same_values(as_json(long), {"text": "x" * 5001})

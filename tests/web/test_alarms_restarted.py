"""A server that is killed keeps its alarms, or says that they were lost until a person acknowledges
that."""

import json
import signal
import sqlite3
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, Final
from urllib.parse import quote

import pytest

from tests.cell.alarms.test_engine import FAULTS
from tests.support.parts import Server, until
from tests.support.servers import demo_server
from tests.web.test_alarms import HEALTHY, LOW, PANEL, SILENT, act, listed

pytestmark = pytest.mark.promise("alarms")

UNKNOWN: Final = """
[[alarm]]
id = "air_unknown"
topic = "/air"
type = "std_msgs/msg/Float64"
text = "Air pressure"
low = 5.0
on_unknown = "raise"
[[alarm]]
id = "node_gone"
node = "/plc"
text = "The PLC's node is gone"
"""
LOST: Final = "panel_alarms_lost"


def server_with(folder: Path, air: str, more: str = UNKNOWN) -> Server:
    return demo_server(folder, PANEL % air + more, KIOSK_DATA=str(folder / "data"))


def killed(server: Server) -> None:
    server.end(signal.SIGKILL)


def in_state(server: Server, alarm: str, state: str) -> dict[str, Any] | None:
    row = listed(server).get(alarm)
    return row if row is not None and row["state"] == state else None


# Their records are read before they are evaluated, whether their source is known by then or not.
KEPT: Final = ("air_unknown", "node_gone", "air_low")


@pytest.mark.long("table")
@pytest.mark.parametrize(
    ("done", "body"),
    [
        ("acknowledge", {}),
        ("shelve", {"reason": "Tests", "for_s": 3600}),
        ("out_of_service", {"reason": "Tests"}),
    ],
)
def test_a_kill_keeps_what_a_person_did(tmp_path: Path, done: str, body: dict[str, Any]) -> None:
    with server_with(tmp_path, LOW) as server:
        for name in KEPT:
            row = until(partial(in_state, server, name, "active"), "it is raised")
            answer = act(server, name, done, **body, occurrence=row["occurrence"]).json()
            assert (answer["done"], answer["reason"]) == (True, "")
        before = listed(server)
        killed(server)
    with server_with(tmp_path, SILENT) as server:
        after = until(lambda: len(listed(server)) > len(KEPT) and listed(server), "they stand")
        assert [_kept(after[name]) for name in KEPT] == [_kept(before[name]) for name in KEPT]
        assert LOST not in after


def _kept(row: dict[str, Any]) -> tuple[Any, ...]:
    taken_out = row["shelf"] or row["out_of_service"] or {}
    by_whom = tuple(taken_out.get(key) for key in ("since", "reason", "who"))
    return row["acknowledged"], row["occurrence"], row["since"], by_whom


def test_an_acknowledgement_of_before_a_restart_is_not_that_of_a_new_alarm(tmp_path: Path) -> None:
    with server_with(tmp_path, LOW) as server:
        seen = until(lambda: in_state(server, "air_low", "active"), "it is raised")["occurrence"]
        assert act(server, "air_low", "acknowledge", occurrence=seen).json()["done"]
        killed(server)
    with server_with(tmp_path, HEALTHY) as server:
        until(lambda: "air_low" not in listed(server), "it is normal")
        killed(server)
    with server_with(tmp_path, LOW) as server:
        until(lambda: in_state(server, "air_low", "active"), "it is raised again")
        answer = act(server, "air_low", "acknowledge", occurrence=seen)
        assert (answer.status_code, answer.json()["code"]) == (409, "alarm_came_again")
        assert not listed(server)["air_low"]["acknowledged"]


def damage(file: Path) -> None:
    file.write_bytes(b"no database" * 1000)


def empty(file: Path) -> None:
    file.write_bytes(b"")


def remove(file: Path) -> None:
    file.unlink()


def spoil_one(file: Path) -> None:
    with sqlite3.connect(file) as db:
        db.execute("UPDATE standing SET record = '{' WHERE id = 'air_low'")
    db.close()


@pytest.mark.long("table")
@pytest.mark.parametrize(
    ("spoil", "cause"),
    [
        (damage, "was damaged. It is kept as alarms.damaged-"),
        (empty, "was empty or removed"),
        (remove, "was empty or removed"),
        (spoil_one, "could not be read: air_low."),
    ],
)
def test_lost_alarms_are_an_alarm_until_a_person_acknowledges_it(
    tmp_path: Path, spoil: Callable[[Path], None], cause: str
) -> None:
    file = tmp_path / "data" / "alarms.sqlite3"
    with server_with(tmp_path, LOW) as server:
        latched = until(lambda: in_state(server, "air_latched", "active"), "it is raised")
        assert act(server, "air_latched", "acknowledge", occurrence=latched["occurrence"]).json()[
            "done"
        ]
        killed(server)
    if spoil is not spoil_one:
        for name in ("-wal", "-shm"):
            Path(f"{file}{name}").unlink(missing_ok=True)
    spoil(file)
    for _ in range(2):
        with server_with(tmp_path, HEALTHY) as server:
            row = until(lambda: in_state(server, LOST, "active"), "the loss is an alarm")
            assert cause in row["cause"]
            assert row["action"]
            assert not row["acknowledged"]
            assert ("air_latched" in listed(server)) == (spoil is spoil_one)
            killed(server)
    with server_with(tmp_path, HEALTHY) as server:
        row = until(lambda: in_state(server, LOST, "active"), "it stands")
        assert act(server, LOST, "acknowledge", occurrence=row["occurrence"]).json()["done"]
        until(lambda: LOST not in listed(server), "it has returned")
        killed(server)
    with server_with(tmp_path, HEALTHY) as server:
        until(lambda: "node_gone" in listed(server), "alarms are evaluated")
        assert LOST not in listed(server)


CODES: Final = ("E1\n2", "E2/..", " E3", "x" * 300 + "1", "x" * 300 + "2", "E4?#%")
WITH_CODES: Final = FAULTS.replace('"/faults"', '"/codes"')


def test_each_code_of_a_robot_can_be_acknowledged(tmp_path: Path) -> None:
    statuses = [{"hardware_id": code, "level": 2, "message": f"{n}"} for n, code in enumerate(CODES)]
    published = json.dumps(statuses).replace('":', '"=')
    demo = f'[demo."/codes"]\nmessage.status = {published}\n'
    with server_with(tmp_path, HEALTHY, demo + WITH_CODES) as server:

        def codes() -> list[str]:
            return [name for name in listed(server) if name.startswith("faults:")]

        until(lambda: len(codes()) == len(CODES), "all are raised")
        for name, row in listed(server).items():
            if name.startswith("faults:"):
                answer = act(server, quote(name), "acknowledge", occurrence=row["occurrence"])
                assert answer.json()["done"]
        assert all(listed(server)[name]["acknowledged"] for name in codes())

"""Another panel file is sent to a running server: its check, its take, and how that ends."""

import json
import signal
import socket
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Final

import pytest

from tests.support.parts import until
from tests.support.sent_panels import OTHER, PANEL, ZIP, Kiosk, packed


@pytest.fixture
def kiosk(tmp_path: Path) -> Iterator[Kiosk]:
    own = Kiosk(tmp_path)
    yield own
    own.close()


def test_sent_panel_is_compared_taken_and_shown(kiosk: Kiosk) -> None:
    checked = kiosk.check(OTHER).json()
    assert (checked["faults"], checked["refusal"], checked["files"]) == ([], "", [])
    assert '-label = "Start"  # the first one\n+label = "Go"  # the first one\n' in checked["diff"]
    assert kiosk.panel.read_text() == PANEL
    in_force = kiosk.engineer.get("/panel/file").json()
    assert (in_force["text"], in_force["hash"]) == (PANEL, checked["compared"])

    receipt = kiosk.take(checked, id="once").json()
    assert (receipt["outcome"], receipt["code"]) == ("accepted", "")
    assert kiosk.take(checked, id="once").json() == receipt
    state = kiosk.ended("kept")
    assert kiosk.panel.read_text() == OTHER
    assert state["last"]["new"] == checked["sent"]
    assert ">Go<" in kiosk.server.http.get("/").text
    assert kiosk.log == [
        ("panel_take", "accepted", "engineer"),
        ("panel_kept", "succeeded", "engineer"),
    ]
    backup = kiosk.panel.parent / ".panel.toml.sent/backups/0001/panel.toml"
    assert backup.read_text() == PANEL


def test_check_of_a_faulty_panel_says_what_this_version_does_not_know(kiosk: Kiosk) -> None:
    checked = kiosk.check("newer_key = 1\n" + OTHER).json()
    (fault,) = checked["faults"]
    assert (fault["place"], fault["line"], checked["sent"]) == ("newer_key", 1, "")
    assert "unknown key" in fault["message"]


def test_what_changed_on_the_kiosk_is_not_overwritten(kiosk: Kiosk) -> None:
    checked = kiosk.check(OTHER).json()
    by_hand = PANEL.replace("Start", "Begin")
    kiosk.panel.write_text(by_hand)
    answer = kiosk.take(checked)
    assert (answer.status_code, answer.json()["code"]) == (409, "panel_sent_changed")
    assert kiosk.panel.read_text() == by_hand
    pressed = kiosk.engineer.post("/widgets/start", json={"inputs": {}})
    assert pressed.json()["outcome"] == "published"
    again = kiosk.check(OTHER).json()
    assert '-label = "Begin"' in again["diff"]
    assert kiosk.log == [("panel_take", "refused", "engineer")]


# Who is refused, by the token: the status of reading, checking and taking.
WHO: Final = {"": (403, 403, 403), "wrong": (401, 401, 401), "maintenance": (403, 403, 403)}


@pytest.mark.parametrize("who", WHO)
def test_only_an_engineer_sends(kiosk: Kiosk, who: str) -> None:
    checked = kiosk.check(OTHER).json()
    client = kiosk.client("opt_wrong" if who == "wrong" else kiosk.tokens.get(who, ""))
    body = {"sent": checked["sent"], "compared": checked["compared"]}
    answers = (
        client.get("/panel/file"),
        client.post("/panel/check", content=packed(OTHER), headers=ZIP),
        client.post("/panel/take", json=body),
    )
    assert tuple(answer.status_code for answer in answers) == WHO[who]
    assert kiosk.panel.read_text() == PANEL


def test_a_second_check_at_the_same_time_is_told_when_to_try_again(kiosk: Kiosk) -> None:
    with ThreadPoolExecutor(3) as threads:
        answers = [*threads.map(lambda _: kiosk.check(OTHER), range(3))]
    refused = [answer for answer in answers if answer.status_code != 200]
    assert len(refused) == 2
    assert [(each.status_code, each.headers["retry-after"]) for each in refused] == [(429, "2")] * 2


def test_server_without_permission_or_without_users_takes_none(tmp_path: Path) -> None:
    own = Kiosk(tmp_path, KIOSK_TAKE_PANEL="")
    try:
        answer = own.engineer.get("/panel")
        assert answer.status_code == 404
        assert "KIOSK_TAKE_PANEL" in answer.json()["error"]
        assert not (own.panel.parent / ".panel.toml.sent").exists()
    finally:
        own.close()
    own = Kiosk(tmp_path, KIOSK_DATA=str(tmp_path / "without-users"))
    try:
        answer = own.client("").get("/panel")
        assert answer.status_code == 403
        assert "users token" in answer.json()["error"]
    finally:
        own.close()


def test_server_that_may_not_write_says_which_file(kiosk: Kiosk) -> None:
    kiosk.server.end()
    kiosk.start(app="tests.support.apps.read_only_panel:app")
    answer = kiosk.check(OTHER)
    assert answer.status_code == 422
    assert str(kiosk.panel) in answer.json()["error"]
    assert str(kiosk.panel) in kiosk.state()["refusal"]


# What keeps the server from coming up with a sent panel, by its title, and how the take ends.
NOT_UP: Final = {
    "ends at import": "panel_restored_no_start",
    "ends at start": "panel_restored_no_start",
    "fails at start": "panel_restored_fault",
}


@pytest.mark.parametrize("title", NOT_UP)
def test_panel_with_which_the_server_does_not_start_is_taken_back(tmp_path: Path, title: str) -> None:
    kiosk = Kiosk(tmp_path)
    try:
        kiosk.server.end()
        kiosk.start(app="tests.support.apps.fails_by_title:app")
        port = kiosk.server.port
        checked = kiosk.check(OTHER.replace("Cell 1", title)).json()
        assert kiosk.take(checked).json()["outcome"] == "accepted"
        if title != "fails at start":  # the service manager starts it again
            until(lambda: not kiosk.server.process.running, "the server has ended")
            kiosk.server.end(signal.SIGKILL)
            kiosk.start(port, "tests.support.apps.fails_by_title:app")
        last = kiosk.ended("restored")["last"]
        assert kiosk.panel.read_text() == PANEL
        assert "was taken back" in last["text"]
        assert ("this panel does not start" in last["text"]) is (title == "fails at start")
        until(lambda: len(kiosk.log) == 2, "the log has it")
        assert kiosk.log == [
            ("panel_take", "accepted", "engineer"),
            ("panel_restored", "aborted", "engineer"),
        ]
        diagnostics = kiosk.engineer.get("/diagnostics", headers={"accept": "text/html"})
        assert "was taken back" in diagnostics.text
    finally:
        kiosk.close()


def test_client_that_is_gone_finds_what_came_of_its_panel(kiosk: Kiosk) -> None:
    checked = kiosk.check(OTHER).json()
    body = json.dumps({"sent": checked["sent"], "compared": checked["compared"], "id": "lost"})
    head = (
        f"POST /panel/take HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: {len(body)}\r\n"
        f"Content-Type: application/json\r\nAuthorization: Bearer {kiosk.tokens['engineer']}\r\n\r\n"
    )
    with socket.create_connection(("127.0.0.1", kiosk.server.port)) as lost:
        lost.sendall((head + body).encode())
        until(lambda: not (state := kiosk.state()) or state["last"], "the kiosk has it")
    assert kiosk.ended("kept")["last"]["new"] == checked["sent"]
    assert kiosk.take(checked, id="lost").json()["outcome"] == "accepted"
    assert kiosk.panel.read_text() == OTHER


def test_server_that_is_killed_while_it_takes_comes_back(kiosk: Kiosk) -> None:
    checked = kiosk.check(OTHER).json()
    port = kiosk.server.port
    kiosk.take(checked)
    kiosk.server.process.kill()
    kiosk.server.end(signal.SIGKILL)
    kiosk.start(port)
    assert kiosk.ended("kept")["last"]["new"] == checked["sent"]
    assert kiosk.panel.read_text() == OTHER

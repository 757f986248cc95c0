"""The command that an acknowledgement sends: it has the permission, the receipt and the log of a press,
and does not decide about the acknowledgement."""

import csv
import io
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import pytest

from tests.support.parts import Server, until
from tests.support.servers import demo_server
from tests.web.test_alarms import LOW, PANEL, act, listed

COMMANDS: Final = """
[[page.widget]]
id = "code"
kind = "text"
label = "Code"
max_length = 20
[[page.widget]]
id = "tell"
kind = "publish"
label = "Tell the robot"
topic = "/acknowledged"
type = "std_msgs/msg/String"
message = { data = "{code}" }
[[page.widget]]
id = "told"
kind = "readout"
label = "Told"
topic = "/acknowledged"
type = "std_msgs/msg/String"
[[page.widget]]
id = "silence"
kind = "call"
label = "Silence"
service = "/silence"
type = "std_srvs/srv/Trigger"
interlock = "permit"
[[interlock]]
id = "permit"
label = "permit"
topic = "/permit"
max_age_s = 2.0
[demo."/permit"]
silent = true
[demo]
"""
TOLD: Final = 'low = 5.0\nack_command = "tell"\nack_input = "code"'
REFUSED: Final = 'latched = true\nack_command = "silence"'


@pytest.fixture
def cell(tmp_path: Path) -> Iterator[Server]:
    """`air_low` tells the robot its code, and the command of `air_latched` is refused."""
    panel = PANEL.replace("[demo]\n", COMMANDS).replace("low = 5.0", TOLD, 1)
    with demo_server(tmp_path, panel.replace("latched = true", REFUSED) % LOW) as server:
        until(lambda: len(listed(server)) == 2, "the alarms are raised")
        yield server


def logged(server: Server) -> list[tuple[str, str, str]]:
    """(action, widget, outcome) of each entry."""
    rows = csv.DictReader(io.StringIO(server.http.get("/log.csv").text.removeprefix("\ufeff")))
    return [(row["action"], row["widget"], row["outcome"]) for row in rows]


def test_the_robot_gets_the_code_and_the_receipt_is_shown(cell: Server) -> None:
    answer = act(cell, "air_low", "acknowledge", occurrence=1, id="a1").json()
    assert answer["done"]
    assert answer["command"]["widget"] == "tell"
    assert answer["command"]["outcome"] == "published"
    assert answer["reason"].startswith("Acknowledged. Tell the robot: ")
    until(lambda: cell.widget("told")["text"] == "air_low", "the robot has the code")
    assert act(cell, "air_low", "acknowledge", occurrence=1, id="a1").json() == answer
    assert act(cell, "air_low", "acknowledge", occurrence=1, id="a2").json()["command"] is None
    presses = [entry for entry in logged(cell) if entry[1] == "tell"]
    assert len({outcome for _, _, outcome in presses}) == len(presses)  # one press


def test_a_refused_command_leaves_the_alarm_acknowledged_and_says_so(cell: Server) -> None:
    answer = act(cell, "air_latched", "acknowledge", occurrence=1).json()
    assert answer["done"]
    assert answer["command"]["outcome"] == "refused"
    assert answer["reason"].startswith("Acknowledged on the panel only. Silence: ")
    assert listed(cell)["air_latched"]["acknowledged"]
    entries = logged(cell)
    assert any(action == "alarm_acknowledge" for action, _, _ in entries)
    assert any(entry[1:] == ("silence", "refused") for entry in entries)


def test_a_form_shows_what_became_of_the_command(cell: Server) -> None:
    fields = {"occurrence": "1", "id": "f1", "page": "/pages/main", "_since": "0"}
    answer = cell.http.post("/alarms/air_latched/acknowledge", data=fields)
    assert answer.headers["location"] == "/pages/main?act=f1.acknowledge.air_latched"
    page = cell.http.get(answer.headers["location"]).text
    assert "Acknowledged on the panel only. Silence: " in page


def test_no_command_is_sent_where_nothing_is_acknowledged(cell: Server) -> None:
    refused = act(cell, "air_low", "acknowledge", occurrence=0).json()
    assert (refused["code"], refused["command"]) == ("alarm_came_again", None)
    act(cell, "air_low", "shelve", for_s=600, reason="Tests")
    assert not [entry for entry in logged(cell) if entry[1] == "tell"]


def test_several_alarms_press_a_control_without_an_input_once(tmp_path: Path) -> None:
    silence = REFUSED.removeprefix("latched = true\n")
    panel = PANEL.replace("[demo]\n", COMMANDS.replace('interlock = "permit"\n', ""))
    panel = panel.replace("low = 5.0", f"low = 5.0\n{silence}")
    with demo_server(tmp_path, panel % LOW) as server:
        until(lambda: len(listed(server)) == 2, "the alarms are raised")
        body = {"alarms": {"air_low": 1, "air_latched": 1}, "id": "a1"}
        receipts = server.http.post("/alarms/acknowledge", json=body).json()["receipts"]
        assert [receipt["done"] for receipt in receipts] == [True, True]
        sent = [receipt["command"] for receipt in receipts if receipt["command"]]
        assert [command["outcome"] for command in sent] == ["succeeded"]

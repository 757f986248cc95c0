"""Alarms of a server: raised, shown on the stream, acknowledged over HTTP, and kept over a restart."""

import csv
import io
import json
import re
import signal
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import httpx
import pytest

from tests.support.parts import Server, until
from tests.support.servers import demo_server

pytestmark = pytest.mark.promise("alarms")

PANEL = """
title = "Cell"
language = "en"
[[page]]
id = "main"
title = "Main"
[[page.widget]]
id = "air"
kind = "readout"
label = "Air"
topic = "/air"
type = "std_msgs/msg/Float64"
[demo]
"/air" = { %s }
[[alarm]]
id = "air_low"
topic = "/air"
type = "std_msgs/msg/Float64"
text = { en = "Air pressure low", ja = "空気圧低下" }
cause = "A leak"
action = { en = "Open valve V1", ja = "バルブ V1 を開く" }
group = "Air"
unit = "bar"
low = 5.0
priority = 2
[[alarm]]
id = "air_latched"
topic = "/air"
type = "std_msgs/msg/Float64"
text = "Air was lost"
low = 5.0
priority = 1
latched = true
"""
LOW = "values = [4.5]"
HEALTHY = "values = [6.0]"
SILENT = "silent = true"


def server_with(folder: Path, air: str = LOW, more: str = "", data: Path | None = None) -> Server:
    environment = {} if data is None else {"KIOSK_DATA": str(data)}
    return demo_server(folder, PANEL % air + more, **environment)


@pytest.fixture
def cell(tmp_path: Path) -> Iterator[Server]:
    """Its alarms are active."""
    with server_with(tmp_path) as server:
        until(lambda: len(listed(server)) == 2, "the alarms are raised")
        yield server


@pytest.fixture(scope="module")
def acknowledged(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """Its alarms are active, and one is acknowledged; no test changes them."""
    with server_with(tmp_path_factory.mktemp("cell")) as server:
        until(lambda: len(listed(server)) == 2, "the alarms are raised")
        assert act(server, "air_low", "acknowledge", occurrence=1).status_code == 200
        yield server


def listed(server: Server, **headers: str) -> dict[str, dict[str, Any]]:
    alarms = server.http.get("/alarms", headers=headers).json()["alarms"]
    return {alarm["id"]: alarm for alarm in alarms}


def act(server: Server, alarm: str, act: str, **body: Any) -> httpx.Response:
    return server.http.post(f"/alarms/{alarm}/{act}", json=body)


def history(server: Server, **query: Any) -> dict[str, Any]:
    response: dict[str, Any] = server.http.get("/alarms", params={"history": "true", **query}).json()
    return response


def test_an_alarm_is_listed_with_its_text_and_value_in_the_readers_language(cell: Server) -> None:
    alarm = listed(cell)["air_low"]
    assert (alarm["state"], alarm["acknowledged"], alarm["occurrence"]) == ("active", False, 1)
    assert (alarm["priority"], alarm["value"], alarm["limit"]) == (2, 4.5, 5.0)
    assert (alarm["text"], alarm["action"]) == ("Air pressure low", "Open valve V1")
    assert (alarm["value_text"], alarm["state_text"]) == ("4.5 bar", "Active, unacknowledged")
    assert datetime.fromisoformat(alarm["since"]) < datetime.now(UTC)
    assert alarm["acts"] == ["acknowledge", "shelve", "out_of_service"]
    japanese = listed(cell, **{"accept-language": "ja"})["air_low"]
    assert (japanese["text"], japanese["priority_text"]) == ("空気圧低下", "中")


def test_the_most_urgent_is_the_line_and_the_events_bring_changes_only(cell: Server) -> None:
    shown = cell.alarms_shown(standing=2, unacknowledged=2, more=0)
    assert shown["line"]["id"] == "air_latched"
    assert list(shown["rows"]) == ["air_latched", "air_low"]
    assert shown["priorities"]["2"] == {"standing": 1, "unacknowledged": 1, "raised": 1}
    with cell.stream() as stream:
        stream.next("snapshot")
        assert act(cell, "air_latched", "acknowledge", occurrence=1).status_code == 200
        _, event, _ = stream.next("alarms")
    assert list(event["rows"]) == ["air_latched"]
    assert event["line"]["id"] == "air_low"
    assert (event["standing"], event["unacknowledged"]) == (2, 1)


def test_an_act_is_idempotent_checked_and_logged(cell: Server) -> None:
    receipt = act(cell, "air_low", "acknowledge", occurrence=1, id="a1").json()
    assert (receipt["outcome"], receipt["done"], receipt["alarm"]) == ("succeeded", True, "air_low")
    assert act(cell, "air_low", "acknowledge", occurrence=1, id="a1").json() == receipt
    stale = act(cell, "air_latched", "acknowledge", occurrence=0)
    assert (stale.status_code, stale.json()["code"]) == (409, "alarm_came_again")
    assert act(cell, "air_low", "acknowledge").status_code == 422
    assert act(cell, "air_low", "dance").status_code == 404
    assert act(cell, "oil", "acknowledge", occurrence=1).json()["code"] == "alarm_gone"
    assert act(cell, "air_latched", "reset").json()["code"] == "alarm_still_active"
    rows = history(cell)["history"]
    assert [(row["id"], row["act"]) for row in rows if row["act"]] == [("air_low", "acknowledge")]
    page = cell.http.get("/log").text
    assert "Acknowledge alarm" in page
    assert "Acknowledged: Air pressure low." in page


def test_metrics_count_alarms_raises_and_times_to_acknowledge(acknowledged: Server) -> None:
    text = acknowledged.http.get("/metrics").text
    assert 'kiosk_alarms{priority="1",state="active"} 1.0' in text
    assert 'kiosk_alarms{priority="4",state="shelved"} 0.0' in text
    assert 'kiosk_alarms_raised_total{priority="1"} 1.0' in text
    assert 'kiosk_alarms_raised_total{priority="2"} 1.0' in text
    assert 'kiosk_alarm_acknowledge_seconds_count{priority="1"} 0.0' in text
    assert 'kiosk_alarm_acknowledge_seconds_count{priority="2"} 1.0' in text


def test_shelving_has_a_reason_and_an_end(cell: Server) -> None:
    until_text = (datetime.now(UTC) + timedelta(minutes=10)).isoformat()
    assert act(cell, "air_low", "shelve", until=until_text).json()["code"] == "alarm_reason_missing"
    high = act(cell, "air_latched", "shelve", until=until_text, reason="Tests")
    assert high.json()["code"] == "alarm_shelve_high"
    assert act(cell, "air_low", "shelve", for_s=600, reason="Tests").status_code == 200
    alarm = listed(cell)["air_low"]
    assert (alarm["state"], alarm["shelf"]["reason"]) == ("shelved", "Tests")
    cell.alarms_shown(shelved=1)
    assert act(cell, "air_low", "unshelve").status_code == 200
    assert (listed(cell)["air_low"]["state"], listed(cell)["air_low"]["occurrence"]) == ("active", 2)


def test_a_page_acknowledges_what_it_shows_at_once(cell: Server) -> None:
    answer = cell.http.post(
        "/alarms/acknowledge", json={"alarms": {"air_low": 1, "air_latched": 0}, "id": "a1"}
    )
    assert answer.status_code == 409
    done = {receipt["alarm"]: receipt["done"] for receipt in answer.json()["receipts"]}
    assert done == {"air_low": True, "air_latched": False}
    assert not listed(cell)["air_latched"]["acknowledged"]


def test_a_form_without_scripts_goes_back_to_its_page(cell: Server) -> None:
    fields = {"occurrence": "1", "id": "f1", "page": "/pages/main", "_since": "0"}
    answer = cell.http.post("/alarms/air_low/acknowledge", data=fields)
    assert (answer.status_code, answer.headers["location"]) == (303, "/pages/main")
    assert listed(cell)["air_low"]["acknowledged"]
    again = cell.http.post("/alarms/air_latched/acknowledge", data={**fields, "occurrence": "0"})
    assert re.fullmatch(r"/pages/main\?act=f1\.acknowledge\.air_latched", again.headers["location"])
    referring = {"referer": f"{cell.url}/alarms?group=Air"}
    several = cell.http.post(
        "/alarms/acknowledge", data={"occurrence.air_latched": "1"}, headers=referring
    )
    assert several.headers["location"] == "/alarms?group=Air"
    away = {"occurrence.air_low": "1", "id": "f1", "page": "//x.y", "_since": "0"}
    elsewhere = cell.http.post("/alarms/acknowledge", data=away)
    assert elsewhere.headers["location"].startswith("/?act=") or elsewhere.headers["location"] == "/"


def test_who_has_no_control_changes_no_alarm(tmp_path: Path) -> None:
    with server_with(tmp_path, more="[control]\nrequired = true\n") as server:
        until(lambda: len(listed(server)) == 2, "the alarms are raised")
        refused = act(server, "air_low", "acknowledge", occurrence=1)
        assert (refused.status_code, refused.json()["code"]) == (409, "control_free")
        assert server.http.post("/control/take", json={}).json()["done"]
        assert act(server, "air_low", "acknowledge", occurrence=1).status_code == 200


def test_the_history_has_pages_and_a_search(cell: Server) -> None:
    for occurrence in (1, 1):
        act(cell, "air_low", "acknowledge", occurrence=occurrence)
    act(cell, "air_low", "out_of_service", reason="Tests")
    first = history(cell, limit=2)
    assert [row["state"] for row in first["history"]] == ["out_of_service", "active"]
    second = history(cell, limit=2, before=first["older"])
    assert {row["id"] for row in second["history"]} == {"air_low", "air_latched"}
    assert second["history"][0]["seq"] < first["history"][-1]["seq"]
    events = history(cell, text="was lost")["history"]
    assert [(row["id"], row["text"], row["priority"]) for row in events] == [
        ("air_latched", "Air was lost", 1)
    ]


def test_what_stood_is_not_known_after_a_kill_and_is_normal_when_it_is_heard(tmp_path: Path) -> None:
    data = tmp_path / "data"
    server = server_with(tmp_path, data=data)
    until(lambda: len(listed(server)) == 2, "the alarms are raised")
    assert act(server, "air_low", "acknowledge", occurrence=1).status_code == 200
    server.end(signal.SIGKILL)
    with server_with(tmp_path, SILENT, data=data) as server:
        alarms = listed(server)
        assert {a["id"]: (a["state"], a["acknowledged"]) for a in alarms.values()} == {
            "air_latched": ("unknown", False),
            "air_low": ("unknown", True),
        }
        assert alarms["air_low"]["occurrence"] == 1
        server.alarms_shown(standing=2)
    with server_with(tmp_path, HEALTHY, data=data) as server:
        until(lambda: "air_low" not in listed(server), "it is normal")
        latched = until(lambda: listed(server)["air_latched"], "it is latched")
        assert (latched["state"], latched["acknowledged"]) == ("latched", False)
        assert act(server, "air_latched", "reset").json()["code"] == "alarm_acknowledge_first"
        assert act(server, "air_latched", "acknowledge", occurrence=1).status_code == 200
        assert act(server, "air_latched", "reset").status_code == 200
        assert listed(server) == {}


def test_an_alarm_locks_its_controls_with_its_text_and_action(tmp_path: Path) -> None:
    start = """
[[page.widget]]
id = "start"
kind = "publish"
label = "Start"
topic = "/start"
type = "std_msgs/msg/Empty"
message = {}
[demo]"""
    panel = PANEL.replace("[demo]", start).replace("latched = true", 'inhibits = ["start"]') % LOW
    with demo_server(tmp_path, panel) as server:
        until(lambda: len(listed(server)) == 2, "the alarms are raised")
        lock = server.widget("start")
        assert (lock["enabled"], lock["reason"]) == (False, "Alarm: Air was lost.")
        refused = server.http.post("/widgets/start", json={"inputs": {}})
        assert (refused.status_code, refused.json()["code"]) == (409, "alarm_inhibits")
        assert act(server, "air_latched", "acknowledge", occurrence=1).status_code == 200
        assert not server.widget("start")["enabled"]
    with demo_server(tmp_path, panel.replace("4.5", "6.0")) as server:
        until(lambda: server.widget("start")["enabled"], "the control opens")
        assert server.http.post("/widgets/start", json={"inputs": {}}).status_code == 200


def test_every_row_is_json_that_the_description_has(cell: Server) -> None:
    described = cell.http.get("/openapi.json").json()["components"]["schemas"]["AlarmAnswer"]
    (alarm, _) = listed(cell).values()
    assert set(alarm) == set(described["properties"])
    json.dumps(alarm, allow_nan=False)


def test_the_history_says_what_happened_and_is_filtered(acknowledged: Server) -> None:
    newest, *raises = history(acknowledged)["history"]
    assert (newest["event"], newest["id"], newest["limit"]) == ("acknowledged", "air_low", 5.0)
    assert 0 < newest["lasted_s"] < 600
    assert {(row["event"], row["lasted_s"], row["clock_back_s"]) for row in raises} == {
        ("raised", None, 0.0)
    }
    of_priority = history(acknowledged, priority=1)["history"]
    assert [row["id"] for row in of_priority] == ["air_latched"]
    assert len(history(acknowledged, group="Air")["history"]) == 2
    assert history(acknowledged, alarm="air_latched", text="air")["history"] == of_priority
    assert history(acknowledged, robot="right")["history"] == []


def test_the_page_of_the_history_is_read_in_the_readers_language(acknowledged: Server) -> None:
    page = acknowledged.http.get("/alarms/history", headers={"accept-language": "ja"}).text
    assert "空気圧低下" in page
    assert "後に確認" in page
    assert "3 件中 1–3 件" in page
    assert "時計は戻されていません" in page
    searched = acknowledged.http.get("/alarms/history", params={"text": "latched", "span": "all"}).text
    assert "Events 1–1 of 1, newest first" in searched
    assert "raised, 4.5 bar, limit 5.0 bar" not in searched  # it has no unit
    nothing = acknowledged.http.get("/alarms/history?until=2020-01-01T00:00").text
    assert "No event has this." in nothing
    assert acknowledged.http.get("/alarms/history?since=2020-02-31T00:00").status_code == 422


def test_the_history_is_exported_as_the_page_shows_it(acknowledged: Server) -> None:
    answer = acknowledged.http.get("/alarms/history.csv?group=Air", headers={"accept-language": "ja"})
    assert answer.headers["content-type"].startswith("text/csv")
    assert re.fullmatch(
        r'attachment; filename="alarms-\d{8}-\d{6}\.csv"', answer.headers["content-disposition"]
    )
    rows = list(csv.DictReader(io.StringIO(answer.text.removeprefix("\ufeff"))))
    assert [row["event"] for row in rows] == ["acknowledged", "raised"]
    assert (rows[0]["text"], rows[0]["unit"], rows[0]["limit"]) == ("空気圧低下", "bar", "5.0")


@pytest.mark.long("detail")
def test_the_header_has_the_state_of_an_active_alarm(tmp_path: Path) -> None:
    state = """
[state]
topic = "/state"
type = "std_msgs/msg/String"
states = [
  { value = "RUNNING", text = "Running", shape = "play" },
  { value = "FAULT", text = { en = "Fault", ja = "異常" }, shape = "cross", colour = "red" },
]
[demo."/state"]
values = ["RUNNING"]
"""
    panel = PANEL.replace("latched = true", 'latched = true\nstate = "FAULT"') + state
    with demo_server(tmp_path, panel % "values = [4.5, 6.0], period_s = 6.0") as server:

        def says(text: str) -> bool:
            return bool(server.snapshot()["widgets"]["machine_state"]["text"] == text)

        until(lambda: says("Fault"), "the alarm is active")
        assert server.snapshot()["widgets"]["machine_state"]["colour"] == "red"
        until(lambda: says("Running"), "the alarm is latched, and no longer active")
        assert listed(server)["air_latched"]["state"] == "latched"


def test_figures_of_the_history_are_json(acknowledged: Server) -> None:
    figures = acknowledged.http.get(
        "/alarms/figures?span=24h", headers={"accept-language": "ja"}
    ).json()
    assert (figures["raised"], figures["worst_10_min"], figures["standing_24_h"]) == (2, 2, 0)
    assert figures["by_priority"] == {"1": 1, "2": 1, "3": 0, "4": 0}
    assert figures["per_hour"] == pytest.approx(2 / 24)
    assert figures["acknowledge_median_s"] > 0
    assert sum(figures["by_hour"].values()) == 2
    assert {(row["id"], row["raised"], row["share"]) for row in figures["top"]} == {
        ("air_low", 1, 0.5),
        ("air_latched", 1, 0.5),
    }
    assert "空気圧低下" in {row["text"] for row in figures["top"]}
    assert figures["chattering"] == []
    past = acknowledged.http.get("/alarms/figures?until=2020-01-01T00:00").json()
    assert (past["raised"], past["top"]) == (0, [])
    described = acknowledged.http.get("/openapi.json").json()["components"]["schemas"]["FiguresAnswer"]
    assert set(figures) == set(described["properties"])


def test_an_alarm_that_follows_another_of_its_group_says_so(tmp_path: Path) -> None:
    panel = PANEL.replace('text = "Air was lost"', 'text = "Air was lost"\ngroup = "Air"')
    with demo_server(tmp_path, panel % LOW) as server:
        until(lambda: len(listed(server)) == 2, "the alarms are raised")
        first, second = sorted(listed(server).values(), key=lambda alarm: alarm["follows"])
        assert (first["follows"], second["follows"]) == ("", first["id"])
        assert second["follows_text"].endswith(f"s after {first['text']}")
        raises = history(server, alarm=second["id"])["history"]
        assert [(row["follows"], row["follows_text"], row["since"]) for row in raises] == [
            (first["id"], second["follows_text"], second["since"])
        ]
        assert history(server, alarm=first["id"])["history"][0]["follows"] == ""
        page = server.http.get("/alarms", headers={"accept": "text/html"}).text
        assert f'data-alarm="{first["id"]}"' in page
        assert page.count('data-first="true"') == 1


@pytest.mark.long("detail")
def test_a_value_has_the_sign_of_its_most_urgent_active_alarm(tmp_path: Path) -> None:
    with server_with(tmp_path, "values = [4.5, 6.0], period_s = 6.0") as server:
        until(lambda: server.widget("air")["alarmed"] == "1", "the alarm of high priority is active")
        until(lambda: server.widget("air")["alarmed"] == "", "none is active")
        assert listed(server)["air_latched"]["state"] == "latched"
        assert 'data-alarmed=""' in server.http.get("/").text

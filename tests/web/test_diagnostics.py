"""The page of diagnostics and its JSON, with a simulated robot: rows, live looks, acts, and how it is
turned off."""

import csv
import io
import json
import zipfile
from collections.abc import Iterator
from html import unescape
from pathlib import Path
from typing import Any

import httpx
import pytest

from app.cell.robot.clocks import APART_S
from app.cell.session.looks import LINGER_S, MOST_AT_ONCE
from app.system.texts import render, say
from app.web.pages.diagnostics import DiagnosticsAnswer, LookAnswer
from tests.support.parts import Server, until
from tests.support.servers import demo_server

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
[[page.widget]]
id = "count"
kind = "readout"
label = "Count"
topic = "/count"
type = "std_msgs/msg/Int32"
qos = { reliability = "best_effort" }
[[page.widget]]
id = "name"
kind = "readout"
label = "Name"
topic = "/name"
type = "std_msgs/msg/String"
[[page.widget]]
id = "last"
kind = "readout"
label = "Last"
topic = "/last"
type = "std_msgs/msg/Bool"
[[page.widget]]
id = "go"
kind = "publish"
label = "Go"
topic = "/go"
type = "std_msgs/msg/Bool"
message = { data = true }
[[page.widget]]
id = "reset"
kind = "call"
label = "Reset"
service = "/reset"
type = "std_srvs/srv/Trigger"
[[page.widget]]
id = "speed"
kind = "parameter"
label = "Speed"
node = "/drive"
parameter = "speed"
type = "double"
[demo]
"/air" = { values = [4.5] }
"""
HTML = {"accept": "text/html"}


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with demo_server(tmp_path_factory.mktemp("cell"), PANEL) as server:
        yield server


def diagnostics(server: Server, **query: Any) -> dict[str, Any]:
    answer = server.http.get("/diagnostics", params=query)
    assert answer.status_code == 200, answer.text
    DiagnosticsAnswer.model_validate_json(answer.text)
    content: dict[str, Any] = answer.json()
    return content


def page(server: Server, **query: Any) -> str:
    answer = server.http.get("/diagnostics", params=query, headers=HTML)
    assert (answer.status_code, answer.headers["content-type"][:9]) == (200, "text/html")
    return answer.text


def topic(server: Server, name: str) -> dict[str, Any]:
    return next(row for row in diagnostics(server)["topics"] if row["name"] == name)


def look(server: Server, key: str) -> httpx.Response:
    return server.http.get("/diagnostics/look", params={"topic": key})


def test_topics_have_rate_size_age_and_qos(cell: Server) -> None:
    until(lambda: topic(cell, "/air")["rate_hz"], "a rate is known")
    air = topic(cell, "/air")
    assert (air["key"], air["expression"], air["type"]) == ("air", "air", "std_msgs/msg/Float64")
    assert (air["use"], air["state"], air["size"]) == ("subscribed", "ok", 12)
    assert 0 < air["rate_hz"] < 100
    assert 0 <= air["age_s"] < 30
    assert air["own_qos"] in ("", "reliable")  # the publisher's, once that is known
    assert air["robot_qos"][0].startswith("reliable")
    assert topic(cell, "/count")["own_qos"] == "best effort"
    go = topic(cell, "/go")
    assert (go["use"], go["rate_hz"], go["own_qos"]) == ("published", None, "reliable, volatile")


def test_services_and_parameters_have_their_last_results(cell: Server) -> None:
    assert cell.press("reset", inputs={}).status_code == 200
    (server,) = diagnostics(cell)["servers"]
    assert (server["kind"], server["name"], server["outcome"]) == ("service", "/reset", "succeeded")
    assert server["result"]
    (parameter,) = diagnostics(cell)["parameters"]
    assert (parameter["node"], parameter["name"], parameter["state"]) == ("/drive", "speed", "ok")
    assert parameter["read_at"]


def test_links_have_round_trips_and_the_sentences_of_the_lamps(cell: Server) -> None:
    until(lambda: diagnostics(cell)["links"][1]["round_trips"], "the bridge has answered")
    links = {link["name"]: link for link in diagnostics(cell)["links"]}
    shown = cell.snapshot()["link"]
    for name, link in links.items():
        assert (link["text"], link["reason"]) == (shown[name]["text"], shown[name]["reason"])
    trips = links["bridge"]["round_trips"]
    assert 0 < trips["least"] <= trips["median"] <= trips["most"]
    assert (links["server"]["round_trips"], links["bridge"]["trip_note"]) == (None, "")


@pytest.mark.long("detail")
def test_the_robots_clock_is_measured_by_its_peer(cell: Server) -> None:
    until(lambda: diagnostics(cell)["clock"]["state"] == "even", "the clock is measured")
    clock = diagnostics(cell)["clock"]
    assert abs(clock["skew_s"]) < APART_S
    assert (clock["within_s"] > 0, clock["reason"]) == (True, "")


def test_the_round_trip_to_a_node_is_measured_while_someone_asks(cell: Server) -> None:
    def node() -> Any:
        return diagnostics(cell)["links"][2]

    trips = until(lambda: node()["round_trips"], "a node has answered")
    assert 0 < trips["least"] <= trips["median"] <= trips["most"]
    assert "/drive" in node()["trip_note"]
    until(lambda: len(node()["round_trips"]["medians"]) > 1, "it is asked again", within_s=60)


def test_a_robot_without_a_node_that_can_be_asked_has_the_reason(tmp_path: Path) -> None:
    without = PANEL.partition('[[page.widget]]\nid = "speed"')[0]
    why = render(say("diagnostics_trip_no_node", node=""), "en")
    with demo_server(tmp_path, without) as server:
        until(lambda: diagnostics(server)["links"][2]["trip_note"] == why, "the reason is said")
        assert diagnostics(server)["links"][2]["round_trips"] is None
        assert why in page(server)


def test_a_browser_has_its_own_round_trips(cell: Server) -> None:
    with httpx.Client(base_url=cell.url, headers=HTML) as browser, httpx.Client() as other:
        browser.get("/diagnostics")
        for ms in ("1203", "3004", "1805"):
            text = browser.get("/diagnostics", params={"part": "content", "rtt": ms}).text
        assert "1203 ms to 3004 ms" in text
        assert "1805 ms" in text
        assert "1203 ms" not in other.get(f"{cell.url}/diagnostics", headers=HTML).text


def test_graph_has_the_robots_topics_and_what_the_panel_uses(cell: Server) -> None:
    def row() -> Any:
        return next((t for t in diagnostics(cell)["graph"]["topics"] if t["name"] == "/air"), None)

    until(row, "the graph is read")
    assert (row()["types"], row()["used"]) == (["std_msgs/msg/Float64"], True)
    assert diagnostics(cell)["graph"]["at"]


@pytest.mark.parametrize("view", ["links", "topics", "servers", "graph", "nodes"])
@pytest.mark.parametrize("language", ["en", "ja", "de"])
def test_each_list_is_a_page_without_scripts(cell: Server, view: str, language: str) -> None:
    answer = cell.http.get(
        "/diagnostics", params={"view": view}, headers={**HTML, "accept-language": language}
    )
    assert answer.status_code == 200
    assert f'data-view="{view}"' in answer.text
    assert '<meta http-equiv="refresh"' in answer.text


def test_search_leaves_other_rows_out(cell: Server) -> None:
    assert "/air" in page(cell)
    matching = page(cell, search="int32")
    assert 'data-row="subscribed count"' in matching
    assert 'data-row="subscribed air"' not in matching
    assert "Nothing matches." in page(cell, search="nothing has this")


def test_content_alone_has_no_frame(cell: Server) -> None:
    content = page(cell, part="content", rtt="12.5")
    assert "<html" not in content
    assert "12 ms" in content
    assert 'data-row="subscribed air"' in content


def test_a_look_shows_messages_and_ends_when_no_one_asks(cell: Server) -> None:
    answer = look(cell, "air")
    content = LookAnswer.model_validate_json(answer.text)
    assert content.types == ["std_msgs/msg/Float64"]
    assert content.messages[0].lines == ["data: 4.5"]
    assert content.messages[0].hex_lines[0].startswith("0000  00 01 00 00")
    assert diagnostics(cell)["looks"] == ["air"]
    assert "data: 4.5" in page(cell, look="air")
    assert "0000  00 01 00 00" in page(cell, look="air", form="hex")
    until(lambda: not diagnostics(cell)["looks"], "the look has ended", within_s=LINGER_S + 30)


@pytest.mark.long("detail")
def test_a_few_looks_at_once_and_only_into_topics_that_exist(cell: Server) -> None:
    keys = ["air", "count", "name", "last"]
    answers = [look(cell, key) for key in keys]
    assert [answer.status_code for answer in answers] == [200] * MOST_AT_ONCE + [429]
    assert answers[-1].headers["retry-after"]
    assert "already being looked at" in page(cell, look="last")
    assert look(cell, "nothing").status_code == 404
    assert look(cell, "@/*/router").status_code == 404
    assert look(cell, "**").status_code == 404
    until(lambda: not diagnostics(cell)["looks"], "the looks have ended", within_s=LINGER_S + 30)


def test_check_is_an_act_whose_findings_are_shown(cell: Server) -> None:
    assert diagnostics(cell)["doctor"]["at"] is None
    receipt = cell.http.post("/diagnostics/check", json={"id": "check-0001"})
    assert receipt.status_code == 200, receipt.text
    assert (receipt.json()["done"], receipt.json()["outcome"]) == (True, "accepted")
    until(lambda: diagnostics(cell)["doctor"]["at"], "the doctor has checked", within_s=120)
    doctor = diagnostics(cell)["doctor"]
    assert {"demo_mode", "server_running"} <= {finding["code"] for finding in doctor["findings"]}
    assert not doctor["running"]
    assert "simulated robot" in page(cell)
    assert f"Findings: {len(doctor['findings'])}" in page(cell)
    again = cell.http.post("/diagnostics/check", json={"id": "check-0001"})
    assert again.json()["id"] == "check-0001"
    assert not diagnostics(cell)["doctor"]["running"]
    entries = cell.http.get("/log", headers=HTML).text
    assert "Check by the doctor" in entries


def test_bundle_is_the_commands_and_logged(cell: Server) -> None:
    answer = cell.http.post("/diagnostics/bundle", data={"id": "b" * 16, "page": ""}, timeout=120)
    assert (answer.status_code, answer.headers["content-type"]) == (200, "application/zip")
    assert 'filename="operator-panel-support-' in answer.headers["content-disposition"]
    with zipfile.ZipFile(io.BytesIO(answer.content)) as bundle:
        assert bundle.testzip() is None
        names = set(bundle.namelist())
        assert {"doctor.json", "panel.json", "logs/journal.json", "state/metrics.txt"} <= names
        assert json.loads(bundle.read("state/readyz.json"))["ready"]
        assert '"Air"' not in bundle.read("panel.json").decode()
    entries = cell.http.get("/log", headers=HTML).text
    assert "Support bundle" in entries


def test_acts_of_other_sites_and_malformed_ones_are_refused(cell: Server) -> None:
    strange = cell.http.post("/diagnostics/bundle", headers={"origin": "http://elsewhere.example"})
    assert strange.status_code == 403
    assert cell.http.post("/diagnostics/other").status_code == 404
    assert cell.http.post("/diagnostics/check", json={"id": "!"}).status_code == 422


def test_panel_without_the_page(tmp_path: Path) -> None:
    with demo_server(tmp_path, f"{PANEL}[diagnostics]\nenabled = false\n") as server:
        for answer in (
            server.http.get("/diagnostics"),
            look(server, "air"),
            server.http.post("/diagnostics/bundle"),
        ):
            assert answer.status_code == 404
            assert "enabled = false" in answer.json()["error"]
        assert "/diagnostics" not in server.http.get("/", headers=HTML, follow_redirects=True).text


def kinds_logged(server: Server) -> set[str]:
    return {row["kind"] for row in csv.DictReader(io.StringIO(server.http.get("/log.csv").text))}


def test_the_clock_of_the_pc_is_on_the_page_in_the_metrics_and_in_the_log(cell: Server) -> None:
    """What it is on the machine of the test is not known; each place has the same."""
    until(lambda: "clock" in kinds_logged(cell), "the time source is in the log")
    (row,) = (row for row in diagnostics(cell)["machine"] if row["id"] == "time")
    states = {"ok": "time_synchronised", "problem": "time_unsynchronised", "unknown": "time_unknown"}
    assert 'data-row="time"' in page(cell)
    sentence = render(say(states[row["state"]]))
    assert sentence in unescape(cell.http.get("/log").text)
    known = [line for line in cell.http.get("/metrics").text.splitlines() if "kiosk_time_synch" in line]
    value = {"ok": ["1.0"], "problem": ["0.0"], "unknown": []}[row["state"]]
    assert [line.split()[1] for line in known if not line.startswith("#")] == value

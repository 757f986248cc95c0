"""The diagnostics of a real node over the real bridge: rates, QoS, the graph, and a live look that
touches nothing of the panel's."""

import json
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import pytest
import zenoh

from app.cell.session.looks import LINGER_S
from app.system.texts import render, say
from tests.bridge.test_cameras_on_bridge import is_read
from tests.support.parts import Bridge, RosNode, Server, free_port, live, until
from tests.support.servers import live_server, panel_file

FLOAT, INT, STRING = "std_msgs/msg/Float64", "std_msgs/msg/Int32", "std_msgs/msg/String"
PANEL: Final = """
title = "Cell"
[[page]]
id = "one"
title = "One"
[[page.widget]]
id = "air"
kind = "readout"
label = "Air"
topic = "/test_air"
type = "std_msgs/msg/Float64"
[[page.widget]]
id = "words"
kind = "readout"
label = "Words"
topic = "/test_words"
type = "std_msgs/msg/String"
[[page.widget]]
id = "strict"
kind = "readout"
label = "Strict"
topic = "/test_strict"
type = "std_msgs/msg/Int32"
qos = { reliability = "reliable" }
[[page.widget]]
id = "silent"
kind = "readout"
label = "Silent"
topic = "/test_silent"
type = "std_msgs/msg/Int32"
"""
HZ: Final = 20.0


@pytest.fixture(scope="module")
def session(bridge: Bridge) -> Iterator[zenoh.Session]:
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", json.dumps([bridge.endpoint]))
    with zenoh.open(config) as opened:
        yield opened


@pytest.fixture(scope="module")
def cell(bridge: Bridge, node: RosNode, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    node.advertise("/test_air", FLOAT, reliability="best_effort")
    node.every("/test_air", {"data": 5.61}, 1 / HZ)
    node.advertise("/test_words", STRING)
    node.advertise("/test_strict", INT, reliability="best_effort")
    node.advertise("/test_other", INT, reliability="best_effort", depth=3)
    node.every("/test_other", {"data": 7}, 1 / HZ)
    with live_server(bridge, tmp_path_factory.mktemp("cell"), PANEL) as server:
        yield server
    for topic in ("/test_air", "/test_words", "/test_strict", "/test_other"):
        node.withdraw(topic)


def diagnostics(server: Server) -> dict[str, Any]:
    content: dict[str, Any] = server.http.get("/diagnostics").json()
    return content


def topic(server: Server, name: str) -> dict[str, Any]:
    return next(row for row in diagnostics(server)["topics"] if row["name"] == name)


def in_graph(server: Server, name: str) -> dict[str, Any] | None:
    topics = diagnostics(server)["graph"]["topics"]
    return next((row for row in topics if row["name"] == name), None)


def look(server: Server, key: str) -> dict[str, Any]:
    answer = server.http.get("/diagnostics/look", params={"topic": key})
    assert answer.status_code == 200, answer.text
    content: dict[str, Any] = answer.json()
    return content


def reader(session: zenoh.Session, name: str) -> str:
    """The bridge's DDS reader of a topic."""
    replies = session.get(f"@/*/ros2/route/topic/pub{name}")
    routes = [json.loads(reply.ok.payload.to_string()) for reply in replies if reply.ok]
    return " ".join(str(route["dds_reader"]) for route in routes)


def test_a_nodes_topics_have_their_rate_and_the_qos_of_both_sides(cell: Server) -> None:
    until(lambda: topic(cell, "/test_air")["count"] > 5 * HZ, "it is heard for some seconds")
    air = topic(cell, "/test_air")
    assert air["rate_hz"] == pytest.approx(HZ, rel=0.3)
    assert (air["robot_qos"], air["size"], air["state"]) == (["best effort, volatile"], 12, "ok")
    until(lambda: topic(cell, "/test_strict")["state"] == "problem", "its QoS is known")
    strict = topic(cell, "/test_strict")
    assert (strict["own_qos"], strict["robot_qos"]) == ("reliable", ["best effort, volatile"])
    assert "/test_strict" in strict["reason"]
    silent = topic(cell, "/test_silent")
    assert (silent["robot_qos"], silent["age_s"], silent["state"]) == ([], None, "unknown")


def test_what_cannot_be_decoded_is_shown_with_its_first_bytes(
    cell: Server, session: zenoh.Session
) -> None:
    def arrived() -> bool:
        session.put("test_words", bytes.fromhex("00010000 ffffff7f 41"))
        return bool(topic(cell, "/test_words")["undecodable_count"])

    until(arrived, "it is read")
    words = topic(cell, "/test_words")
    assert words["undecodable"]["first"] == "00 01 00 00 ff ff ff 7f 41"
    assert words["undecodable"]["reason"]
    page = cell.http.get("/diagnostics", headers={"accept": "text/html"}).text
    assert "00 01 00 00 ff ff ff 7f 41" in page


def test_the_graph_has_the_node_and_topics_that_the_panel_does_not_use(cell: Server) -> None:
    until(lambda: in_graph(cell, "/test_other"), "the graph is read")
    other = in_graph(cell, "/test_other")
    assert other is not None
    assert (other["types"], other["used"]) == ([INT], False)
    assert other["publishers"] == ["/system_controller"]
    assert other["publisher_qos"][0].startswith("best effort, volatile")
    nodes = {row["name"]: row for row in diagnostics(cell)["graph"]["nodes"]}
    assert "/test_other" in nodes["/system_controller"]["publishes"]
    assert nodes["/system_controller"]["dds"]
    assert diagnostics(cell)["links"][1]["round_trips"]["median"] > 0


def test_a_node_on_another_dds_than_the_bridges_is_not_asked(cell: Server) -> None:
    why = render(say("diagnostics_trip_no_node", node=""))
    until(lambda: diagnostics(cell)["links"][2]["trip_note"] == why, "the reason is said")
    assert diagnostics(cell)["links"][2]["round_trips"] is None


def per_second(server: Server, key: str) -> float:
    """How many messages of a topic arrive while it is looked into."""
    began, first = time.monotonic(), look(server, key)["received"]
    until(lambda: look(server, key)["received"] - first > 2 * HZ, "more arrive")
    return float((look(server, key)["received"] - first) / (time.monotonic() - began))


def test_a_look_reads_any_topic_and_leaves_no_reader(cell: Server, session: zenoh.Session) -> None:
    until(lambda: in_graph(cell, "/test_other"), "the graph is read")
    for _ in range(3):  # what begins again must not add up in the bridge
        until(lambda: look(cell, "test_other")["messages"], "a message is shown")
        message = look(cell, "test_other")["messages"][0]
        assert (message["lines"], message["reason"]) == (["data: 7"], "")
        assert is_read(session, "/test_other")
        assert per_second(cell, "test_other") < 1.6 * HZ, "each message arrives once"
        until(lambda: not diagnostics(cell)["looks"], "no one looks", within_s=LINGER_S + 60)
        until(lambda: not is_read(session, "/test_other"), "the bridge has no reader of it")


def test_a_look_into_a_topic_of_the_panel_changes_nothing_of_its_own(
    cell: Server, session: zenoh.Session
) -> None:
    until(lambda: topic(cell, "/test_air")["count"], "the panel reads it")
    before, qos = reader(session, "/test_air"), topic(cell, "/test_air")["robot_qos"]
    until(lambda: look(cell, "test_air")["messages"], "a message is shown")
    assert reader(session, "/test_air") == before
    until(lambda: not diagnostics(cell)["looks"], "no one looks", within_s=LINGER_S + 60)
    assert reader(session, "/test_air") == before
    assert topic(cell, "/test_air")["robot_qos"] == qos
    count = topic(cell, "/test_air")["count"]
    until(lambda: topic(cell, "/test_air")["count"] > count, "the panel still reads it")


@pytest.mark.long("detail")
def test_a_finding_about_a_link_is_the_links_own_sentence(tmp_path: Path) -> None:
    with (
        zenoh_router() as endpoint,
        live(endpoint, tmp_path, KIOSK_PANEL=panel_path(tmp_path)) as server,
    ):
        until(server.answers, "it serves")
        until(lambda: diagnostics(server)["links"][1]["reason"], "the link is judged")
        assert server.http.post("/diagnostics/check").status_code == 200
        until(lambda: diagnostics(server)["doctor"]["at"], "the doctor has checked", within_s=120)
        (finding,) = [
            f for f in diagnostics(server)["doctor"]["findings"] if f["code"].startswith("link")
        ]
        assert finding["code"] == "link_no_peer"
        assert finding["what"] == diagnostics(server)["links"][1]["reason"]
        japanese = {"accept": "text/html", "accept-language": "ja"}
        page = server.http.get("/diagnostics?view=links", headers=japanese).text
        assert page.count(render(say("link_no_peer"), "ja")) >= 2


@contextmanager
def zenoh_router() -> Iterator[str]:
    """The endpoint of a router that no bridge is connected to."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    config = zenoh.Config()
    config.insert_json5("mode", '"router"')
    config.insert_json5("listen/endpoints", json.dumps([endpoint]))
    config.insert_json5("scouting/multicast/enabled", "false")
    with zenoh.open(config):
        yield endpoint


def panel_path(folder: Path) -> str:
    return str(panel_file(folder, PANEL))

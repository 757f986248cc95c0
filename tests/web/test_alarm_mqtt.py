"""Alarms by MQTT, at a real broker: transitions, the standing list, the last will, a lost broker."""

import signal
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import pytest

from tests.support.certificates import make_certificates
from tests.support.mosquitto import Broker, listening, stands
from tests.support.parts import Server, until
from tests.support.servers import demo_server
from tests.web.test_alarms import LOW, PANEL, act, listed

pytestmark = pytest.mark.promise("neighbours")

HASTY: Final = "tests.support.apps.hasty:app"
TOPIC: Final = "plant1/cell"
BROWSER: Final = {"accept": "text/html"}
MQTT: Final = '\n[alarms.mqtt]\nhost = "127.0.0.1"\nport = %d\nprefix = "plant1/cell"\n'


@pytest.fixture
def broker(tmp_path: Path) -> Iterator[Broker]:
    made = Broker(tmp_path)
    made.start()
    yield made
    made.end()


def cell_at(folder: Path, port: int, more: str = "", **environment: str) -> Server:
    return demo_server(folder, PANEL % LOW + MQTT % port + more, **environment)


def test_transitions_and_the_retained_list_are_published(broker: Broker, tmp_path: Path) -> None:
    with listening(broker.port, TOPIC) as listener, cell_at(tmp_path, broker.port) as cell:
        stands(listener, "air_low", "air_latched")
        act(cell, "air_low", "acknowledge", occurrence=1)
        until(lambda: len(listener.received["transitions"]) == 3, "the acknowledgement is published")
        raised, other, acknowledged = listener.received["transitions"]
        assert {raised["event"], other["event"]} == {"raised"}
        assert (acknowledged["id"], acknowledged["event"]) == ("air_low", "acknowledged")
        assert acknowledged["text"] == "Air pressure low"
        assert "seq" not in acknowledged
        with listening(broker.port, TOPIC) as late:
            stands(late, "air_low", "air_latched")
            assert late.newest("state") == "online"
            assert late.received["transitions"] == []
        metrics = cell.http.get("/metrics").text
        assert "kiosk_alarms_mqtt_connected 1.0" in metrics
        assert "kiosk_alarms_mqtt_published_total 3.0" in metrics


@pytest.mark.parametrize("way", [signal.SIGTERM, signal.SIGKILL])
def test_a_panel_that_ends_is_offline(broker: Broker, tmp_path: Path, way: signal.Signals) -> None:
    with listening(broker.port, TOPIC) as listener, cell_at(tmp_path, broker.port) as cell:
        until(lambda: listener.newest("state") == "online", "the panel is online")
        cell.process.send(way)
        until(lambda: listener.newest("state") == "offline", "the broker says that it is offline")


def test_what_happened_without_a_broker_is_published_when_it_is_back(
    broker: Broker, tmp_path: Path
) -> None:
    with cell_at(tmp_path, broker.port) as cell, listening(broker.port, TOPIC) as listener:
        stands(listener, "air_low", "air_latched")
        broker.end()
        until(lambda: "mqtt_connected 0.0" in cell.http.get("/metrics").text, "the loss is known")
        act(cell, "air_low", "acknowledge", occurrence=1)
        assert listed(cell)["air_low"]["acknowledged"]
        broker.start()
        until(
            lambda: (
                "acknowledged" in {t["event"] for t in listener.received["transitions"]}
                or bool(listener.newest("standing")["alarms"][-1]["acknowledged"])
            ),
            "the act is published",
        )
        stands(listener, "air_low", "air_latched")


@pytest.mark.parametrize("where", ["env", "file"])
def test_the_password_is_outside_of_the_panel_file(tmp_path: Path, where: str) -> None:
    broker = Broker(tmp_path, "panel", "s3cret")
    broker.start()
    secret = tmp_path / "password"
    secret.write_text("s3cret\n")
    named = f'password_file = "{secret}"' if where == "file" else 'password_env = "BROKER_PASSWORD"'
    more = f'username = "panel"\n{named}\n'
    try:
        with (
            listening(broker.port, TOPIC, "panel", "s3cret") as listener,
            cell_at(tmp_path, broker.port, more, BROKER_PASSWORD="s3cret"),
        ):
            stands(listener, "air_low", "air_latched")
    finally:
        broker.end()


def test_a_broker_that_does_not_answer_delays_nothing(tmp_path: Path) -> None:
    with socket.socket() as silent:
        silent.bind(("127.0.0.1", 0))
        silent.listen()
        with cell_at(tmp_path, silent.getsockname()[1]) as cell:
            until(lambda: len(listed(cell)) == 2, "the alarms are raised")
            assert act(cell, "air_low", "acknowledge", occurrence=1).json()["done"]
            assert "kiosk_alarms_mqtt_connected 0.0" in cell.http.get("/metrics").text


def cause(cell: Server) -> str:
    """What the panel's own alarm of the broker says; "" without one."""
    return str(listed(cell).get("panel_mqtt", {}).get("cause", ""))


def mqtt_state(cell: Server) -> dict[str, Any]:
    state: dict[str, Any] = cell.http.get("/diagnostics").json()["mqtt"]
    return state


def test_diagnostics_say_whether_the_broker_has_a_connection(broker: Broker, tmp_path: Path) -> None:
    with cell_at(tmp_path, broker.port) as cell:
        until(lambda: mqtt_state(cell)["published"] == 2, "the raises are published")
        state = mqtt_state(cell)
        assert (state["connected"], state["state"], state["waiting"]) == (True, "connected", 0)
        assert (state["address"], state["last_error"]) == (f"127.0.0.1:{broker.port}", "")
        page = cell.http.get("/diagnostics", headers=BROWSER).text
        assert "Alarms by MQTT" in page
        assert "connected since" in page
        broker.end()
        until(lambda: not mqtt_state(cell)["connected"], "the loss is known")
        act(cell, "air_low", "acknowledge", occurrence=1)
        until(lambda: mqtt_state(cell)["waiting"] == 1, "the act waits")
        assert mqtt_state(cell)["last_error"]
        assert "no connection since" in cell.http.get("/diagnostics?part=content", headers=BROWSER).text


@pytest.mark.long("detail")
def test_a_broker_with_tls_is_trusted_by_its_authority_only(tmp_path: Path) -> None:
    certificates = make_certificates(tmp_path)
    broker = Broker(tmp_path, certificates=certificates)
    broker.start()
    trusted = f'tls = true\nca = "{certificates.ca.name}"\n'
    try:
        with (
            listening(broker.port, TOPIC) as listener,
            cell_at(tmp_path, broker.tls_port, trusted) as cell,
        ):
            stands(listener, "air_low", "air_latched")
            assert mqtt_state(cell)["connected"]
        other = tmp_path / "other"
        other.mkdir()
        strange = make_certificates(other).ca
        for ca in ("", f'ca = "{strange.relative_to(tmp_path)}"\n'):
            with cell_at(tmp_path, broker.tls_port, f"tls = true\n{ca}", app=HASTY) as cell:
                until(lambda: mqtt_state(cell)["last_error"], "the certificate is refused")
                assert not mqtt_state(cell)["connected"]
                assert "certificate is not trusted" in mqtt_state(cell)["last_error"]
                page = cell.http.get("/diagnostics?part=content", headers=BROWSER).text
                assert "certificate is not trusted" in page
                until(lambda: "certificate is not trusted" in cause(cell), "the alarm says why")
        plain = tmp_path / "plain"
        plain.mkdir()
        with cell_at(plain, broker.tls_port) as cell:
            until(lambda: mqtt_state(cell)["last_error"], "it speaks no TLS")
            assert not mqtt_state(cell)["connected"]
    finally:
        broker.end()

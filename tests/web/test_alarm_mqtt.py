"""Alarms by MQTT, at a real broker: transitions, the standing list, the last will, a lost broker."""

import signal
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import pytest

from tests.support.mosquitto import Broker, listening, stands
from tests.support.parts import Server, until
from tests.support.servers import demo_server
from tests.web.test_alarms import LOW, PANEL, act, listed

TOPIC: Final = "plant1/cell"
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

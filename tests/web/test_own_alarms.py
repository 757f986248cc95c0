"""The panel's own alarms on a server: without any alarm in the panel file, and off if it says so."""

import json
import signal
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any, Final

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes
from cryptography.x509.oid import NameOID

from app.system.certificates import new_key, pem
from tests.faults.clock import Clock
from tests.support.parts import ROOT, Server, until
from tests.support.servers import demo_server

PAGE: Final = """
title = "Cell"
[[page]]
id = "main"
title = "Main"
[[page.widget]]
id = "note"
kind = "label"
label = "Note"
"""
FULL: Final = "[alarms]\ndisk_free_mb = 1e6\n"  # no disk here has so much
TWO_ROBOTS: Final = """
[[robot]]
id = "r1"
name = "Robot 1"
namespace = "/r1"
[[robot]]
id = "r2"
name = "Robot 2"
namespace = "/r2"
"""


@pytest.fixture
def full(tmp_path: Path) -> Iterator[Server]:
    """A server whose disk is nearly full."""
    with demo_server(tmp_path, PAGE + FULL, KIOSK_DATA=str(tmp_path / "data")) as server:
        until(lambda: "panel_disk" in listed(server), "the alarm is raised")
        yield server


def listed(server: Server) -> dict[str, dict[str, Any]]:
    return {alarm["id"]: alarm for alarm in server.http.get("/alarms").json()["alarms"]}


def test_a_disk_that_is_nearly_full_is_raised_without_an_alarm_in_the_file(full: Server) -> None:
    alarm = listed(full)["panel_disk"]
    assert (alarm["source"], alarm["state"], alarm["priority"]) == ("panel", "active", 3)
    assert "are free. The limit is 1000000 MB." in alarm["cause"]
    assert alarm["action"].startswith("Delete recordings")
    assert full.alarms_shown(standing=1)["line"]["id"] == "panel_disk"
    page = full.http.get("/").text
    assert "data-own" in page
    assert "The disk of the panel is nearly full" in page
    assert full.http.get("/alarms?alarm=panel_disk", headers={"accept": "text/html"}).status_code == 200


def test_it_is_acknowledged_and_needs_no_disk(full: Server, tmp_path: Path) -> None:
    done = full.http.post("/alarms/panel_disk/acknowledge", json={"occurrence": 1})
    assert done.status_code == 200
    assert done.json()["done"]
    full.alarms_shown(line=None)
    assert listed(full)["panel_disk"]["acknowledged"]
    assert not (tmp_path / "data" / "alarms.sqlite3").exists()
    full.end(signal.SIGKILL)
    with demo_server(tmp_path, PAGE + FULL, KIOSK_DATA=str(tmp_path / "data")) as server:
        until(lambda: "panel_disk" in listed(server), "it is raised again")


@pytest.mark.parametrize("more", [FULL + "panel = false\n", ""])
def test_nothing_is_raised_where_the_file_says_so_or_nothing_is_wrong(
    tmp_path: Path, more: str
) -> None:
    with demo_server(tmp_path, PAGE + more) as server:
        assert listed(server) == {}
        assert ("data-own" in server.http.get("/").text) is (not more)


def test_with_several_robots_it_is_of_none(tmp_path: Path) -> None:
    with demo_server(tmp_path, PAGE + FULL + TWO_ROBOTS) as server:
        alarm = until(lambda: listed(server).get("panel_disk"), "the alarm is raised")
        assert alarm["robot"] == ""
        for robot in ("r1", "r2"):
            assert "The disk of the panel is nearly full" in server.http.get(f"/robots/{robot}/").text
        assert server.http.post("/alarms/panel_disk/acknowledge", json={"occurrence": 1}).json()["done"]


@pytest.mark.long("detail")
def test_a_clock_that_is_set_is_raised_once_and_returns(tmp_path: Path) -> None:
    clock = Clock(tmp_path)
    with demo_server(tmp_path, PAGE, **clock.environment) as server:
        clock.set(-3600)
        alarm = until(lambda: listed(server).get("panel_clock"), "the alarm is raised", within_s=20)
        assert alarm["cause"].startswith("It was set back by 1 h")
        until(lambda: listed(server)["panel_clock"]["state"] == "returned", "it returns")
        assert listed(server)["panel_clock"]["occurrence"] == 1
        pid = server.process.pid
    clock.clean(pid)


def certificate(file: Path, days: int) -> None:
    """A self-signed certificate that ends in so many days."""
    key, now = new_key(), datetime.now(UTC)
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "panel")])
    made = (
        x509.CertificateBuilder()
        .subject_name(name)
        .issuer_name(name)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - timedelta(days=1))
        .not_valid_after(now + timedelta(days=days))
        .sign(key, hashes.SHA256())
    )
    file.write_bytes(pem(made))


def test_a_certificate_that_runs_out_is_raised(tmp_path: Path) -> None:
    """It is in the Zenoh file of a live panel; the one that ends first is named."""
    files = {"root_ca_certificate": 400, "listen_certificate": 7, "connect_certificate": 20}
    for name, days in files.items():
        certificate(tmp_path / name, days)
    zenoh = {
        "mode": "peer",
        "connect": {"endpoints": ["tcp/127.0.0.1:1"]},
        "scouting": {"multicast": {"enabled": False}},
        "transport": {"link": {"tls": {name: str(tmp_path / name) for name in files}}},
    }
    (tmp_path / "zenoh.json5").write_text(json.dumps(zenoh))
    (tmp_path / "cell.toml").write_text(PAGE)
    panel, config = str(tmp_path / "cell.toml"), str(tmp_path / "zenoh.json5")
    with Server(ROOT, KIOSK_MODE="live", KIOSK_PANEL=panel, KIOSK_ZENOH=config) as server:
        alarm = until(lambda: listed(server).get("panel_certificate"), "the alarm is raised")
        assert alarm["priority"] == 2
        assert "listen_certificate is valid until" in alarm["cause"]

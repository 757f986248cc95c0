"""A server with `KIOSK_FORWARD`: it sends by itself, and Diagnostics, metrics and an alarm say how that
goes."""

import json
import subprocess
from pathlib import Path
from typing import Any, Final

import pytest

from tests.support.parts import ROOT, Server, until
from tests.support.postgres import PASSWORD, Cluster, query
from tests.support.servers import demo_server
from tests.tools.central.test_forwarding import counts, findings
from tests.web.test_alarms import LOW, PANEL, listed

pytestmark = pytest.mark.promise("history")

HASTY: Final = "tests.support.apps.hasty:app"
SHOWN: Final = {"accept": "text/html", "accept-language": "en"}
NOTHING_SENT: Final = "Nothing was sent to"


def cell_at(server: Cluster, folder: Path, **more: Any) -> Server:
    settings = folder / "forward.toml"
    settings.write_text(
        f'[forward]\npanel = "cell 1"\nsite = "line 2"\nconnection = "{server.string("cell1")}"\n'
        f'password_file = "{server.folder}/cell-password"\nevery_s = 0.2\n'
    )
    return demo_server(folder, PANEL % LOW, KIOSK_FORWARD=str(settings), **more)


def forward(cell: Server) -> dict[str, Any]:
    answer = cell.http.get("/diagnostics", headers={"accept": "application/json"})
    return dict(answer.json()["forward"])


def test_a_server_sends_what_it_keeps(centre: Cluster, tmp_path: Path) -> None:
    with cell_at(centre, tmp_path) as cell:
        until(lambda: counts(centre, "alarms")[0] >= 2, "the alarms are at the centre", 60)
        until(lambda: counts(centre)[0] >= 1, "the log is there")
        until(lambda: counts(centre, "health")[0] >= 1, "its health is there")
        until(lambda: forward(cell)["connected"], "Diagnostics says so")
        about = forward(cell)
        assert about["fault"] == about["note"] == ""
        assert about["address"] == f"127.0.0.1:{centre.port}"
        page = cell.http.get("/diagnostics", headers=SHOWN).text
        assert "Central database" in page
        assert "connected since" in page
        metrics = cell.http.get("/metrics").text
        assert "kiosk_forward_connected 1.0" in metrics
        assert 'kiosk_forward_unsent{stream="log"}' in metrics
        health = query(centre, "SELECT up_s, memory_bytes, cpu_s FROM operator_panel.health LIMIT 1")[0]
        assert 0 < health[0] < 600
        assert 50_000_000 < health[1] < 1_000_000_000
        assert health[2] > 0.1
        assert not has_secret(cell)
    assert all(finding.is_note for finding in findings(centre))


def state_of_alarm(cell: Server) -> str:
    return str(listed(cell).get("panel_forward", {}).get("state", ""))


def has_secret(cell: Server) -> bool:
    """Whether a command line or an environment of the server's processes has the password."""
    listed_pids = subprocess.run(
        ["ps", "-e", "-o", "pid=,ppid="], capture_output=True, text=True, check=True
    ).stdout
    parents = [tuple(map(int, line.split())) for line in listed_pids.splitlines()]
    own = {cell.process.pid}
    own |= {pid for pid, parent in parents if parent in own}
    assert len(own) > 1, "the forwarder runs"
    return any(
        PASSWORD.encode() in Path(f"/proc/{pid}/{name}").read_bytes()
        for pid in own
        for name in ("cmdline", "environ")
    )


def test_a_lost_database_is_an_alarm_and_delays_no_press(centre: Cluster, tmp_path: Path) -> None:
    with cell_at(centre, tmp_path, app=HASTY) as cell:
        until(lambda: forward(cell)["connected"], "connected", 60)
        centre.stop()
        try:
            until(lambda: not forward(cell)["connected"], "the loss is known", 60)
            until(lambda: state_of_alarm(cell) == "active", "the alarm is raised", 60)
            cause = listed(cell)["panel_forward"]["cause"]
            assert f"{NOTHING_SENT} 127.0.0.1:{centre.port}" in cause
            about = forward(cell)
            assert not about["connected"]
            assert "can't be reached" in about["fault"]
            page = cell.http.get("/diagnostics", headers=SHOWN).text
            assert "nothing sent since" in page
            assert "can&#39;t be reached" in page
        finally:
            centre.start()
        until(lambda: forward(cell)["connected"], "connected again", 60)
        until(lambda: state_of_alarm(cell) == "returned", "the alarm returned", 60)


def test_wrong_settings_stop_the_start_with_a_sentence(tmp_path: Path) -> None:
    settings = tmp_path / "forward.toml"
    settings.write_text('[forward]\npanel = "cell 1"\nconnection = "dbname=plant"\nbatch = 0\n')
    with pytest.raises(AssertionError, match=r"batch is 0: it must be a number of rows from 1 to 5000"):
        Server(ROOT, KIOSK_MODE="demo", KIOSK_FORWARD=str(settings))


def test_json_of_a_panel_without_a_central_database_is_null(tmp_path: Path) -> None:
    with demo_server(tmp_path, PANEL % LOW) as cell:
        answer = cell.http.get("/diagnostics", headers={"accept": "application/json"}).text
        assert json.loads(answer)["forward"] is None
        assert "kiosk_forward" not in cell.http.get("/metrics").text

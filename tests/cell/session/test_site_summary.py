"""What a panel with `[site]` publishes, through a real router."""

import json
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any, Final

import pytest
import zenoh

from app.cell.site.summary import read_summary
from app.ros.zenoh.site import alive_key, summary_key
from tests.support.cells import Cells, client_of
from tests.support.parts import ROOT, Server, until
from tests.support.rmw import Router, SessionRouter

SITE: Final = """
[site]
name = "line 2"
cell = "cell 1"
url = "https://cell1.plant.example/"
figures = ["rate"]
connect = [{endpoints}]
"""
PANEL: Final = """
title = {{ en = "Cell 1", de = "Zelle 1" }}
languages = ["en", "de"]
mode = "demo"
{site}
[state]
topic = "/state"
type = "std_msgs/msg/String"
states = [
  {{ value = "RUNNING", text = {{ en = "RUNNING", de = "LÄUFT" }}, shape = "play" }},
]
[demo."/state"]
message = {{ data = "RUNNING" }}
[demo."/rate"]
message = {{ data = 305.0 }}
[[alarm]]
id = "air"
topic = "/rate"
type = "std_msgs/msg/Float64"
field = "data"
high = 300.0
priority = 2
text = {{ en = "Rate too high", de = "Rate zu hoch" }}
action = "Slow down"
[[page]]
id = "main"
title = "Main"
[[page]]
id = "other"
title = "Other"
[[page.widget]]
id = "rate"
kind = "readout"
label = "Rate"
topic = "/rate"
type = "std_msgs/msg/Float64"
field = "data"
unit = "boxes/h"
format = ".0f"
"""


@pytest.fixture
def router() -> Iterator[Router]:
    mine = SessionRouter()
    mine.start()
    yield mine
    mine.end()


def panel_with_site(folder: Path, *routers: str) -> Path:
    file = folder / "cell.toml"
    endpoints = ", ".join(json.dumps(each) for each in routers)
    file.write_text(PANEL.format(site=SITE.format(endpoints=endpoints)))
    return file


class Listener:
    """Hears all of a router's cells."""

    def __init__(self, endpoint: str) -> None:
        self.session = client_of(endpoint)
        self.heard: list[dict[str, Any]] = []
        self.alive: dict[str, bool] = {}
        self._held = (
            self.session.declare_subscriber(
                summary_key(), lambda sample: self.heard.append(json.loads(sample.payload.to_bytes()))
            ),
            self.session.liveliness().declare_subscriber(alive_key(), self._token, history=True),
        )

    def _token(self, sample: zenoh.Sample) -> None:
        self.alive[str(sample.key_expr)] = sample.kind == zenoh.SampleKind.PUT


@pytest.fixture
def listener(router: Router) -> Iterator[Listener]:
    mine = Listener(router.endpoint)
    yield mine
    mine.session.close()


def test_a_panel_publishes_what_its_pages_show(
    router: Router, listener: Listener, tmp_path: Path
) -> None:
    file = panel_with_site(tmp_path, router.endpoint)
    with Server(ROOT, KIOSK_PANEL=str(file), KIOSK_DATA=str(tmp_path)) as cell:
        until(lambda: listener.heard and listener.heard[-1]["alarm_list"], "a summary with the alarm")
        newest = listener.heard[-1]
        read = read_summary(json.dumps(newest).encode(), "line 2", "cell 1")
        assert read.state.text == {"en": "RUNNING", "de": "LÄUFT"}
        assert (read.state.kind, read.simulated, read.links[0].state) == ("running", True, "ok")
        # No page that shows it is open.
        assert (read.figures[0].text, read.figures[0].state) == ("305 boxes/h", "live")
        assert (read.alarms["2"], read.unacknowledged["2"]) == (1, 1)
        assert read.alarm_list[0].text == {"en": "Rate too high", "de": "Rate zu hoch"}
        shown = cell.http.get("/alarms").json()["alarms"]
        assert read.alarm_list[0].since == next(a["since"] for a in shown if a["id"] == "air")
        assert listener.alive == {alive_key("line 2", "cell 1"): True}
        # The whole, for a query.
        answers = listener.session.get("operator-panel/**", timeout=5.0)
        assert [json.loads(a.ok.payload.to_bytes())["cell"] for a in answers if a.ok] == ["cell 1"]
    until(lambda: not listener.alive[alive_key("line 2", "cell 1")], "its token is gone")


def test_two_cells_with_one_name_are_named_on_both(
    router: Router, listener: Listener, tmp_path: Path
) -> None:
    file = panel_with_site(tmp_path, router.endpoint)

    def cause(server: Server) -> str:
        rows = {row["id"]: row for row in server.http.get("/alarms").json()["alarms"]}
        return str(rows.get("panel_site", {}).get("cause", ""))

    (tmp_path / "other").mkdir()
    with (
        Server(ROOT, KIOSK_PANEL=str(file), KIOSK_DATA=str(tmp_path / "first")) as first,
        Server(ROOT, KIOSK_PANEL=str(file), KIOSK_DATA=str(tmp_path / "other")) as other,
    ):
        for server in (first, other):
            until(partial(cause, server), "it is named")
            assert "line 2/cell 1" in cause(server)
        until(lambda: listener.heard[-1]["twin"], "the summary says so")
        assert len({each["instance"] for each in listener.heard}) == 2


def test_what_is_forged_with_its_name_is_named_too(router: Router, tmp_path: Path) -> None:
    file = panel_with_site(tmp_path, router.endpoint)
    forged = Cells(router.endpoint)
    with Server(ROOT, KIOSK_PANEL=str(file), KIOSK_DATA=str(tmp_path)) as cell:

        def named() -> bool:
            forged.put_bytes("line 2", "cell 1", b"\x00forged")
            return any(row["id"] == "panel_site" for row in cell.http.get("/alarms").json()["alarms"])

        until(named, "it is named")
    forged.close()


def test_a_panel_without_a_router_says_so_and_works(tmp_path: Path) -> None:
    file = panel_with_site(tmp_path, "tcp/127.0.0.1:1")
    with Server(ROOT, KIOSK_PANEL=str(file), KIOSK_DATA=str(tmp_path)) as cell:
        until(cell.ready, "commands reach its robot")
        assert cell.http.get("/").status_code == 200

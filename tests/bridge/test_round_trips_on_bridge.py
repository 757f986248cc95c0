"""The round trip to a real node on Cyclone DDS through the real bridge, and the node's silence."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import pytest

from app.system.texts import render, say
from tests.support.cyclone import NODE, CycloneRobot
from tests.support.parts import Bridge, Server, until
from tests.support.servers import live_server

PANEL: Final = """
title = "Cell"
mode = "live"
[[page]]
id = "main"
title = "Main"
[[page.widget]]
id = "reset"
kind = "call"
label = "Reset"
service = "/reset"
type = "std_srvs/srv/Trigger"
"""


@pytest.fixture
def cell(cyclone_bridge: Bridge, robot: CycloneRobot, tmp_path: Path) -> Iterator[Server]:
    with live_server(cyclone_bridge, tmp_path, PANEL) as mine:
        yield mine


def links(server: Server) -> list[dict[str, Any]]:
    links: list[dict[str, Any]] = server.http.get("/diagnostics").json()["links"]
    return links


def note(name: str) -> str:
    return render(say(f"diagnostics_trip_{name}", node=f"/{NODE}"))


def test_the_round_trip_to_a_node_goes_further_than_that_to_the_bridge(
    cell: Server, robot: CycloneRobot
) -> None:
    until(lambda: links(cell)[2]["round_trips"], "the node answers", within_s=60)
    _, bridge, node = links(cell)
    assert node["trip_note"] == note("measured")
    assert node["round_trips"]["least"] > bridge["round_trips"]["least"]
    robot.freeze()
    # After 10 s DDS takes it for gone: on a busy machine it may not have been asked before.
    gone = render(say("diagnostics_trip_no_node", node=""))
    until(lambda: links(cell)[2]["trip_note"] in (note("silent"), gone), "its silence is said")
    robot.thaw()
    assert links(cell)[2]["round_trips"], "those of the last minutes stay"

"""The server of a wall: pages without a panel file, from what cells publish at a real router."""

import json
import re
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import pytest

from app.cell.site.cells import MAX_CELLS, SILENT_S
from app.ros.zenoh.site import alive_key
from tests.support.cells import Cells, alarm, client_of
from tests.support.parts import ROOT, Server, until
from tests.support.rmw import Router, SessionRouter

TILE: Final = re.compile(r'<a data-row="(c[0-9a-f]{10})"(?: data-is="(\w+)")?(.*?)</a>', re.DOTALL)

BYTES_OF_TILE: Final = 165


def wall_server(folder: Path, router: Router, sites: str = "*", **more: Any) -> Server:
    zenoh = folder / "zenoh.json5"
    zenoh.write_text((ROOT / "zenoh.json5").read_text().replace("tcp/127.0.0.1:7447", router.endpoint))
    return Server(ROOT, KIOSK_WALL=sites, KIOSK_ZENOH=str(zenoh), KIOSK_DATA=str(folder), **more)


@pytest.fixture(scope="module")
def router() -> Iterator[Router]:
    mine = SessionRouter()
    mine.start()
    yield mine
    mine.end()


@pytest.fixture
def cells(router: Router) -> Iterator[Cells]:
    mine = Cells(router.endpoint)
    yield mine
    mine.close()


@pytest.fixture(scope="module")
def wall(router: Router, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with wall_server(tmp_path_factory.mktemp("wall"), router) as mine:
        until(mine.ready, "the wall reaches the router")
        yield mine


def page(server: Server, query: str = "", **headers: str) -> str:
    answer = server.http.get(f"/{query}", headers={"accept": "text/html", **headers})
    assert answer.status_code == 200, answer.text
    return str(answer.text)


def tiles(html: str) -> dict[str, tuple[str, str]]:
    """The kind and the rest of each tile, by the cell's name."""
    matches = {
        re.search("<b>(.*?)</b>", rest)[1]: (kind or "running", rest)  # type: ignore[index]
        for _, kind, rest in TILE.findall(html)
    }
    return matches


def shown(server: Server, cell: str, kind: str) -> str:
    """The tile of the cell, once it is of a kind."""

    def tile() -> str | None:
        is_kind, rest = tiles(page(server)).get(cell, ("", ""))
        return rest if is_kind == kind else None

    return str(until(tile, f"{cell} is {kind}"))


def test_a_cell_appears_with_its_state_figure_and_alarm(wall: Server, cells: Cells) -> None:
    cells.put("line 1", "one", "fault", alarm_list=[alarm(1, {"en": "Door open", "de": "Tür offen"})])
    tile = shown(wall, "one", "fault")
    assert 'href="https://one.plant.example/"' in tile
    assert "305<small> boxes/h</small>" in tile
    assert 'data-priority="1"' in tile
    whole = page(wall)
    assert "View only" in whole
    assert "Stop is at each cell" in whole
    assert 'class="stop' not in whole
    assert "Tür offen" in page(wall, **{"accept-language": "de"})
    cells.withdraw("line 1", "one")
    began = time.monotonic()
    assert "No contact since" in shown(wall, "one", "lost")
    assert time.monotonic() - began < SILENT_S  # by its token


def test_what_a_wall_has_asked_for_before_it_started(
    router: Router, cells: Cells, tmp_path: Path
) -> None:
    """A wall that starts late asks the cells for the whole."""
    cells.put("late", "quiet", "manual")
    with wall_server(tmp_path, router, "late") as server:
        shown(server, "quiet", "manual")
        cells.put("elsewhere", "other")
        cells.put("late", "next")
        shown(server, "next", "running")
        assert "other" not in tiles(page(server))  # of another site


def test_hostile_texts_are_shown_as_text(wall: Server, cells: Cells) -> None:
    script = '"><script>alert(1)</script>\u202e'
    state = {"kind": "running", "text": script, "shape": "play", "colour": "grey"}
    alarms = [alarm(2, script)]
    cells.put("hostile", "<i>evil", state=state, alarm_list=alarms, url="", instance="i1")
    until(lambda: "&lt;i&gt;evil" in page(wall), "it is listed")
    until(lambda: "&lt;script&gt;" in page(wall), "its texts are there")
    whole = page(wall)
    assert "<script>alert" not in whole
    assert "\u202e" not in whole
    cells.put("hostile", "bad", url="javascript:alert(1)")
    assert "can&#39;t be read" in shown(wall, "bad", "unknown")
    assert "javascript:" not in page(wall)


def test_two_cells_with_one_name_are_named(wall: Server, router: Router, cells: Cells) -> None:
    other = Cells(router.endpoint)
    try:

        def named() -> bool:
            cells.put("twins", "same", instance="i1")
            other.put("twins", "same", instance="i2")
            return "Two cells" in tiles(page(wall)).get("same", ("", ""))[1]

        until(named, "it is named")
    finally:
        other.close()


def test_a_filter_greys_out_and_a_search_lists(wall: Server, cells: Cells) -> None:
    cells.put("filtered", "runs")
    cells.put("filtered", "stands", "waiting")
    shown(wall, "stands", "waiting")
    shown(wall, "runs", "running")
    listed = tiles(page(wall, "?site=filtered&show=abnormal"))
    assert {name: " data-dim" in rest for name, (_, rest) in listed.items()} == {
        "runs": True,
        "stands": False,
    }
    assert set(tiles(page(wall, "?text=STAND"))) == {"stands"}
    assert "No cell has this name" in page(wall, "?text=nowhere")
    assert wall.http.get("/?show=everything").status_code == 422


def stream(server: Server, query: str, events: int) -> list[dict[str, Any]]:
    data: list[dict[str, Any]] = []
    with server.http.stream("GET", f"/wall/events?{query}", timeout=30.0) as answer:
        assert answer.headers["content-type"].startswith("text/event-stream")
        for line in answer.iter_lines():
            if line.startswith("data: "):
                data.append(json.loads(line.removeprefix("data: ")))
                if len(data) == events:
                    break
    return data


def test_events_bring_what_has_changed_in_view(wall: Server, cells: Cells) -> None:
    for number in range(80):
        cells.put("viewed", f"v{number:02}")
    until(lambda: len(tiles(page(wall, "?site=viewed"))) == 80, "all are there")
    until(lambda: "Waiting for data" not in page(wall, "?site=viewed"), "with their summaries")
    ids = [matches[0] for matches in TILE.findall(page(wall, "?site=viewed"))]
    first = stream(wall, f"site=viewed&first={ids[0]}&last={ids[3]}", 1)[0]
    assert set(first["parts"]) == {"wall_state", "wall_line", "wall_sums", "wall_alarms"}
    assert ids[0] in first["tiles"]
    assert ids[70] not in first["tiles"]  # not in view
    assert set(first["ages"]) >= {ids[0]}
    assert wall.http.get("/wall/events?first=x").status_code == 422
    sizes = [len(match[0]) for match in TILE.finditer(page(wall, "?site=viewed"))]
    assert max(sizes) <= BYTES_OF_TILE, "1,000 cells are less than 200 kB"


def test_metrics_count_cells_and_alarms_in_a_bounded_number_of_lines(
    wall: Server, cells: Cells
) -> None:
    cells.put("metrics", "in fault", "fault", alarm_list=[alarm(1, "Door"), alarm(1, "Air")])
    known = alarm(2, "Oil", acknowledged=True)
    cells.put("metrics", "known", alarm_list=[known], unacknowledged=dict.fromkeys("1234", 0))

    def gauges() -> dict[str, float]:
        lines = wall.http.get("/metrics").text.splitlines()
        rows = (line.rsplit(" ", 1) for line in lines if line.startswith("kiosk_wall"))
        return {name: float(value) for name, value in rows}

    def all_counted() -> dict[str, float] | None:
        read = gauges()
        is_there = read['kiosk_wall_alarms{acknowledged="yes",priority="2"}'] >= 1
        return read if is_there and read['kiosk_wall_cells{state="fault"}'] >= 1 else None

    counted = until(all_counted, "they are counted")
    assert counted["kiosk_wall_connected"] == 1
    assert counted['kiosk_wall_alarms{acknowledged="no",priority="1"}'] >= 2
    assert 0 <= counted["kiosk_wall_oldest_seconds"] <= SILENT_S + 2
    for number in range(50):
        cells.put("metrics", f"m{number}")
    until(lambda: gauges()['kiosk_wall_cells{state="running"}'] >= 50, "all are counted")
    assert gauges().keys() == counted.keys()


def test_nothing_of_a_robot_is_there(wall: Server) -> None:
    for method, path in (
        ("POST", "/widgets/x"),
        ("POST", "/presses"),
        ("POST", "/control/take"),
        ("POST", "/alarms/acknowledge"),
        ("POST", "/alarms/x/reset"),
        ("GET", "/diagnostics"),
        ("POST", "/recipes/x/load"),
        ("GET", "/openapi.json"),
    ):
        assert wall.http.request(method, path).status_code == 404, path
    for path in ("/signin", "/users", "/log", "/help", "/healthz", "/metrics", "/pages/wall"):
        assert wall.http.get(path, headers={"accept": "text/html"}).status_code == 200, path
    assert wall.http.get("/pages/other").status_code == 404


def test_a_wall_without_a_router_says_so(tmp_path: Path) -> None:
    gone = SessionRouter()
    with wall_server(tmp_path, gone) as server:
        assert server.http.get("/readyz").json()["code"] == "wall_no_router"
        assert "No connection" in page(server)
        assert "No cell has been heard yet" in page(server)


def test_a_wall_changes_nothing_at_the_router(router: Router, wall: Server) -> None:
    """It declares no publisher, no queryable and no token of its own."""
    session = client_of(router.endpoint)
    try:
        tokens = [str(r.ok.key_expr) for r in session.liveliness().get("**", timeout=5.0) if r.ok]
        assert [token for token in tokens if not token.startswith("operator-panel/")] == []
    finally:
        session.close()


def test_a_million_tokens_are_counted_and_not_kept(wall: Server, router: Router) -> None:
    """Some thousands of them: what is more than there is room for is the same for each."""
    flood = client_of(router.endpoint)
    try:
        held = [
            flood.liveliness().declare_token(alive_key("flood", f"cell {number}"))
            for number in range(MAX_CELLS + 500)
        ]
        until(lambda: "more cells are not shown" in page(wall, "?site=none"), "it says so", every_s=1)
        assert len(TILE.findall(page(wall))) <= MAX_CELLS
        del held
    finally:
        flood.close()

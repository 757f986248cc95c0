"""Places that operators save: by JSON and by the page's forms, in the list, over a restart."""

import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import pytest

from app.cell.places.saved import read_places
from app.cell.session.place_file import NAME
from tests.support.parts import Server, until
from tests.support.servers import demo_server
from tests.support.users import log_rows
from tests.web.test_map import SILENT
from tests.web.test_places import PANEL, press, version

pytestmark = pytest.mark.promise("places")

SAVES: Final = PANEL.replace("touch = true", "touch = true\nsave = true")


@pytest.fixture(scope="module")
def shuttle(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with demo_server(tmp_path_factory.mktemp("shuttle"), SAVES) as server:
        until(lambda: server.widget("hall")["state"] == "live", "the map is there")
        yield server


def save(server: Server, name: str, **fields: Any) -> Any:
    return server.http.post("/places/goal/save", json={"name": name, **fields}).json()


def touched(server: Server, x: float = 1.5, y: float = 1.0) -> str:
    return f"x={x:.2f} y={y:.2f} yaw=1.57 map={version(server)}"


def offered(server: Server) -> dict[str, Any]:
    return {place["label"]: place for place in server.widget("goal")["places"]}


def test_a_touched_pose_is_saved_offered_sent_logged_and_deleted(shuttle: Server) -> None:
    receipt = save(shuttle, "  Bay   7 ", value=touched(shuttle))
    assert (receipt["outcome"], receipt["code"], receipt["done"]) == ("succeeded", "", True)
    assert receipt["reason"] == "Bay 7 saved: x 1.50 m, y 1.00 m."
    until(lambda: "Bay 7" in offered(shuttle), "it is offered")
    place = offered(shuttle)["Bay 7"]
    assert (place["id"], place["pose"], place["reason"]) == ("bay_7", [1.5, 1.0, 1.57], "")
    assert list(offered(shuttle)) == ["Dock", "Table", "Pit", "Bay 7"]
    status, _, reason = press(shuttle, "bay_7")
    assert (status, reason.partition(":")[0]) == (200, "Bay 7")
    entry = next(row for row in log_rows(shuttle.http) if row["action"] == "place_save")
    assert (entry["kind"], entry["outcome"]) == ("place", "succeeded")
    assert entry["reason"] == "Bay 7 saved: x 1.50 m, y 1.00 m."
    (kept,) = read_places((shuttle.data / NAME).read_bytes()).places
    assert (kept.frame, kept.map_version) == ("map", version(shuttle))
    receipt = shuttle.http.post("/places/goal/delete", json={"place": "bay_7"}).json()
    assert receipt["done"], receipt
    until(lambda: "Bay 7" not in offered(shuttle), "it is gone")
    assert press(shuttle, "bay_7")[:2] == (422, "refused")
    assert (shuttle.data / NAME).read_text() == ""
    again = shuttle.http.post("/places/goal/delete", json={"place": "bay_7"})
    assert (again.status_code, again.json()["code"]) == (409, "saved_place_gone")


def test_where_the_robot_is_can_be_saved(shuttle: Server) -> None:
    receipt = save(shuttle, "Here", map=version(shuttle))
    assert receipt["done"], receipt
    until(lambda: "Here" in offered(shuttle), "it is offered")
    x, y, _ = offered(shuttle)["Here"]["pose"]
    said = re.fullmatch(r"Here saved: x (\S+) m, y (\S+) m\.", receipt["reason"].replace("−", "-"))
    assert said, receipt
    assert [float(text) for text in said.groups()] == pytest.approx([x, y], abs=0.006)  # rounded twice
    assert shuttle.http.post("/places/goal/delete", json={"place": "here"}).json()["done"]


@pytest.mark.parametrize(
    ("name", "fields", "code"),
    [
        ("", {}, "recipe_name_empty"),
        ("x" * 61, {}, "recipe_name_too_long"),
        ("a\u200bb", {}, "recipe_name_unprintable"),
        ("dock", {}, "place_name_taken"),
        ("D0ck", {}, "users_name_alike"),
        ("D\u043eck", {}, "users_name_mixed"),
        ("Old", {"value": "x=1.50 y=1.00 yaw=0.00 map=0123456789abcdef"}, "place_map_changed"),
        ("Old", {"map": "0123456789abcdef"}, "place_map_changed"),
        ("Far", {"value": "x=99.00 y=1.00 yaw=0.00 map={version}"}, "place_outside"),
        ("Pit 2", {"value": "x=-2.00 y=-1.20 yaw=0.00 map={version}"}, "place_in_zone"),
    ],
)
def test_what_is_refused_is_not_saved(
    shuttle: Server, name: str, fields: dict[str, str], code: str
) -> None:
    fields = {key: text.format(version=version(shuttle)) for key, text in fields.items()}
    receipt = save(shuttle, name, **({"value": touched(shuttle)} | fields))
    assert (receipt["outcome"], receipt["code"]) == ("refused", code)
    assert list(offered(shuttle)) == ["Dock", "Table", "Pit"]


@pytest.mark.parametrize("value", ["dock", "gone", "x=1 y=2 yaw=3"])
def test_what_is_no_pose_is_an_error(shuttle: Server, value: str) -> None:
    answer = shuttle.http.post("/places/goal/save", json={"name": "A", "value": value})
    assert answer.status_code == 422


def test_an_input_without_save_has_no_page(shuttle: Server) -> None:
    for path in ("/places/hall", "/places/none"):
        assert shuttle.http.get(path).status_code == 404
        assert shuttle.http.post(f"{path}/save", json={"name": "A"}).status_code == 404


def test_the_page_saves_and_deletes_without_scripts(shuttle: Server) -> None:
    assert 'href="/places/goal?mode=save"' in shuttle.http.get("/").text
    page = shuttle.http.get("/places/goal", params={"mode": "save", "value": touched(shuttle)}).text
    assert "x 1.50 m, y 1.00 m" in page
    fields = dict(re.findall(r'<input type="hidden" name="(id|value|map)" value="([^"]+)"', page))
    assert fields["map"] == version(shuttle)
    answer = shuttle.http.post("/places/goal/save", data={**fields, "name": "Bay 8"})
    assert answer.status_code == 303
    listed = shuttle.http.get(answer.headers["location"]).text
    assert "Bay 8 saved" in listed
    assert 'href="/places/goal?place=bay_8"' in listed
    asked = shuttle.http.get("/places/goal", params={"place": "bay_8", "mode": "delete"}).text
    assert "Delete Bay 8?" in asked
    fields = dict(re.findall(r'<input type="hidden" name="(id|place)" value="([^"]+)"', asked))
    answer = shuttle.http.post("/places/goal/delete", data=fields)
    assert "Bay 8 deleted" in shuttle.http.get(answer.headers["location"]).text
    assert "Bay 8" not in offered(shuttle)


def test_the_same_id_is_the_same_act(shuttle: Server) -> None:
    fields = {"value": touched(shuttle), "id": "save-once"}
    assert save(shuttle, "Once", **fields) == save(shuttle, "Once", **fields)
    assert shuttle.http.post("/places/goal/delete", json={"place": "once"}).json()["done"]


def test_a_place_is_there_after_a_restart_and_a_broken_file_is_named_and_kept(tmp_path: Path) -> None:
    data = tmp_path / "data"
    data.mkdir(mode=0o700)
    with demo_server(tmp_path, SAVES, KIOSK_DATA=str(data)) as server:
        until(lambda: server.widget("hall")["state"] == "live", "the map is there")
        assert save(server, "場所", value=touched(server))["done"]
    (table,) = tomllib.loads((data / NAME).read_text())["place"]
    assert (table["id"], table["label"]) == ("place", "場所")
    with demo_server(tmp_path, SAVES, KIOSK_DATA=str(data)) as server:
        until(lambda: server.widget("hall")["state"] == "live", "the map is there")
        assert offered(server)["場所"]["reason"] == ""
    (data / NAME).write_text("[[place]\n")
    with demo_server(tmp_path, SAVES, KIOSK_DATA=str(data)) as server:
        until(lambda: server.widget("hall")["state"] == "live", "the map is there")
        assert list(offered(server)) == ["Dock", "Table", "Pit"]
        receipt = save(server, "Next", value=touched(server))
        assert (receipt["outcome"], receipt["code"]) == ("refused", "place_file_broken")
        assert "not TOML" in server.http.get("/places/goal").text
    assert (data / NAME).read_text() == "[[place]\n"


def test_a_robot_that_is_not_heard_is_not_saved_but_a_touched_pose_is(tmp_path: Path) -> None:
    with demo_server(tmp_path, SAVES + SILENT) as server:
        value = touched(server)
        until(lambda: not server.widget("drive")["enabled"], "it is locked")
        receipt = save(server, "Here")
        assert receipt["outcome"] == "refused"
        assert "not known where the robot is" in receipt["reason"]
        page = server.http.get("/places/goal", params={"mode": "save"}).text
        assert re.search(r'<button type="submit" class="act" disabled>', page)
        assert save(server, "There", value=value)["done"]

"""Recipes of a server: made, changed, loaded into the robot and read back, and kept over a restart."""

import csv
import html
import io
import re
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import httpx
import pytest

from app.cell.recipes.recipe import MAX_RECIPES, id_for
from tests.cell.recipes.panels import CARTON, PANEL, TRAY
from tests.records.test_on_server import MOUNT, SMALL_DISK, fill, inside
from tests.support.parts import ROOT, Server, until
from tests.support.servers import demo_server, panel_file, ready

pytestmark = pytest.mark.promise("recipes")

FORM = {"content-type": "application/x-www-form-urlencoded"}
CONTROL = "\n[control]\nrequired = true\n"


def server_with(folder: Path, more: str = "", **environment: str) -> Server:
    server = demo_server(folder, PANEL + more, **environment)
    until(lambda: server.widget("boxes")["enabled"] or more, "the node's parameters are there")
    return server


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with server_with(tmp_path_factory.mktemp("cell")) as server:
        yield server


@pytest.fixture
def cell(shared: Server) -> Server:
    """A cell without recipes, which the tests of the module share."""
    for row in exported(shared).values():
        receipt = act(shared, "delete", recipe=id_for(row["name"], ()), version=int(row["version"]))
        assert receipt.json()["done"], receipt.text
    return shared


def act(server: Server, act: str, **body: Any) -> httpx.Response:
    return server.http.post(f"/recipes/boxes/{act}", json=body)


def make(server: Server, name: str = "Carton", values: Any = CARTON) -> None:
    receipt = act(server, "create", name=name, values=values)
    assert (receipt.status_code, receipt.json()["done"]) == (200, True), receipt.text


def load(server: Server, recipe: str, **more: Any) -> httpx.Response:
    return server.http.post("/widgets/boxes", json={"inputs": {"boxes": recipe}, **more})


def page(server: Server, **query: str) -> str:
    text = html.unescape(server.http.get("/recipes/boxes", params=query).text)
    return re.sub(r"\s+", " ", re.sub(r"<[^>]*>", " ", text.partition("<main")[2]))


def exported(server: Server) -> dict[str, dict[str, str]]:
    text = server.http.get("/recipes/boxes.csv").content.decode("utf-8-sig")
    return {row["name"]: row for row in csv.DictReader(io.StringIO(text))}


def entries(server: Server) -> list[dict[str, str]]:
    text = server.http.get("/log.csv").content.decode("utf-8-sig")
    return list(csv.DictReader(io.StringIO(text)))


def test_a_recipe_is_loaded_and_read_back(cell: Server) -> None:
    make(cell)
    assert "In the robot" not in page(cell, recipe="carton").partition("Value")[0]
    assert "1 of 5 values differ" in page(cell, recipe="carton")
    receipt = load(cell, "carton@1").json()
    assert (receipt["outcome"], receipt["code"]) == ("confirmed", "recipe_loaded")
    assert receipt["reason"] == "Carton is loaded: Speed 100 % → 80 %."
    assert "The robot has these values" in page(cell, recipe="carton")
    assert page(cell, recipe="carton").count("In the robot") == 2  # the row's mark, and the column
    assert load(cell, "carton@1").json()["code"] == "recipe_loaded_same"
    make(cell, "Tray", TRAY)
    assert "Gripper Vacuum → Fork" in load(cell, "tray@1").json()["reason"]
    logged = [e for e in entries(cell) if e["widget"] == "boxes" and e["outcome"] == "confirmed"]
    assert "Length 400 mm → 600 mm" in logged[0]["reason"]


def test_the_same_load_again_is_sent_once(cell: Server) -> None:
    make(cell)
    first, second = (load(cell, "carton@1", id="press-1").json() for _ in range(2))
    assert first == second
    assert load(cell, "carton@2", id="press-1").json()["code"] == "press_id_reused"


def test_only_what_the_screen_showed_is_loaded(cell: Server) -> None:
    make(cell)
    act(cell, "save", recipe="carton", version=1, values=TRAY)
    refused = load(cell, "carton@1")
    assert (refused.status_code, refused.json()["code"]) == (422, "recipe_changed_before_load")
    assert load(cell, "other@1").json()["code"] == "recipe_gone"
    assert load(cell, "carton").json()["code"] == "recipe_not_named"
    assert load(cell, "carton@2").json()["outcome"] == "confirmed"


def test_changes_are_acts_of_the_log_with_old_and_new(cell: Server) -> None:
    make(cell)
    before = len(entries(cell))
    body = {"recipe": "carton", "version": 1, "values": {**CARTON, "speed": 60.5}, "id": "act-1"}
    first, second = (act(cell, "save", **body).json() for _ in range(2))
    assert (first["done"], first["id"]) == (True, second["id"])
    assert act(cell, "rename", recipe="carton", version=2, name="Karton").json()["done"]
    assert act(cell, "restore", recipe="carton", version=3, to=1).json()["done"]
    assert act(cell, "copy", recipe="carton", version=4, name="Copy").json()["done"]
    assert act(cell, "delete", recipe="carton", version=4).json()["done"]
    acts = [entry for entry in entries(cell)[:-before] if entry["kind"] == "recipe"]
    logged = {entry["action"]: entry["reason"] for entry in acts}
    assert logged["recipe_save"] == "Boxes: Carton changed: Speed 80 % → 60.5 %."
    assert logged["recipe_rename"] == "Boxes: Carton renamed: Name Carton → Karton."
    assert logged["recipe_restore"] == "Boxes: Karton restored: Speed 60.5 % → 80 %."
    assert logged["recipe_delete"].startswith("Boxes: Karton deleted: Length 400 mm → —")
    assert [*exported(cell)] == ["Copy"]


def test_the_second_browser_is_refused(cell: Server) -> None:
    make(cell)
    assert act(cell, "save", recipe="carton", version=1, values=TRAY).status_code == 200
    refused = act(cell, "save", recipe="carton", version=1, values={**CARTON, "note": "mine"})
    assert (refused.status_code, refused.json()["code"]) == (409, "recipe_changed_since")
    assert exported(cell)["Carton"]["note"] == "x"


def test_recipes_are_kept_over_a_restart_and_a_broken_file_is_only_a_row(tmp_path: Path) -> None:
    data = tmp_path / "data"
    data.mkdir()
    with server_with(tmp_path, KIOSK_DATA=str(data)) as server:
        make(server)
        make(server, "Tray", TRAY)
    file = next(data.rglob("tray.toml"))
    file.write_bytes(file.read_bytes()[:-30])
    with server_with(tmp_path, KIOSK_DATA=str(data)) as server:
        assert "can't be read" in page(server)
        assert [*exported(server)] == ["Carton"]
        assert load(server, "carton@1").json()["outcome"] == "confirmed"


@pytest.mark.long("detail")
def test_a_full_disk_is_said_and_nothing_changes(tmp_path: Path) -> None:
    path = str(panel_file(tmp_path, PANEL))
    before = [*SMALL_DISK, MOUNT, "sh"]
    with ready(Server(ROOT, before=before, KIOSK_PANEL=path, KIOSK_MODE="demo")) as server:
        make(server)
        fill(inside(server))
        refused = act(server, "save", recipe="carton", version=1, values=TRAY)
        assert refused.status_code == 503
        assert refused.json()["outcome"] == "refused"
        assert "no space left on device" in refused.json()["reason"]
        assert exported(server)["Carton"]["gripper"] == "vacuum"


def test_a_client_without_control_changes_and_loads_nothing(tmp_path: Path) -> None:
    with server_with(tmp_path, CONTROL) as server:
        assert act(server, "create", name="Carton", values=CARTON).json()["done"] is False
        assert exported(server) == {}


def test_a_csv_is_imported_and_bad_rows_are_named(cell: Server) -> None:
    make(cell)
    text = "name,length,speed,gripper,fast,note\nCarton,500,80,fork,true,a\nBad,1,80,fork,true,a\n"
    is_csv = {"content-type": "text/csv"}
    receipt = cell.http.post("/recipes/boxes/import", content=text, headers=is_csv)
    assert receipt.json()["done"] is True
    assert "0 new, 1 changed, 0 the same" in receipt.json()["reason"]
    assert "Line 3: Length is 1" in receipt.json()["reason"]
    assert exported(cell)["Carton"]["length"] == "500"
    refused = act(cell, "import", csv="name,length\n")
    assert (refused.status_code, refused.json()["done"]) == (409, False)


def test_an_import_on_the_page_shows_what_changes_before_it_is_taken(cell: Server) -> None:
    make(cell)
    head = "name,length,speed,gripper,fast,note"
    text = f"{head}\nCarton,500,80,fork,WAHR,a\nNew,400,12.5,fork,0,<b>\nBad,1,80,fork,1,a\n"
    shown = cell.http.post("/recipes/boxes/import", data={"-csv": text}, headers=FORM)
    assert shown.status_code == 200
    page = shown.text
    assert "400 mm → <b>500 mm</b>" in page
    assert "&lt;b&gt;" in page
    assert "Line 4: Length is 1" in page
    assert set(exported(cell)) == {"Carton"}  # nothing is taken yet
    assert exported(cell)["Carton"]["length"] == "400"
    seen = re.search(r'name="-seen" value="([0-9a-f]{64})"', page)
    assert seen is not None
    other = text.replace("500", "501")  # what was not shown is compared first
    again = cell.http.post(
        "/recipes/boxes/import", data={"-csv": other, "-seen": seen[1]}, headers=FORM
    )
    assert (again.status_code, exported(cell)["Carton"]["length"]) == (200, "400")
    crlf = text.replace("\n", "\r\n")  # as a form of a browser sends it
    taken = cell.http.post("/recipes/boxes/import", data={"-csv": crlf, "-seen": seen[1]}, headers=FORM)
    assert taken.status_code == 303
    assert exported(cell)["Carton"]["length"] == "500"
    assert exported(cell)["New"]["speed"] == "12.5"


def test_an_import_of_which_the_decimal_sign_is_not_clear_asks_for_it(cell: Server) -> None:
    make(cell)
    text = 'name,length,speed,gripper,fast,note\nCarton,400,"80,125",vacuum,false,-\n'
    asks = cell.http.post("/recipes/boxes/import", data={"-csv": text}, headers=FORM).text
    assert 'name="-decimal" value=","' in asks
    assert 'name="-seen"' not in asks
    chosen = {"-csv": text, "-decimal": ","}
    shown = cell.http.post("/recipes/boxes/import", data=chosen, headers=FORM).text
    assert "80 % → <b>80.125 %</b>" in shown
    refused = act(cell, "import", csv=text)
    assert (refused.status_code, refused.json()["code"]) == (409, "recipe_csv_decimal")
    assert act(cell, "import", csv=text, decimal=",").json()["done"] is True
    assert exported(cell)["Carton"]["speed"] == "80.125"


def test_a_file_of_bytes_is_read_as_spreadsheets_write_it(cell: Server) -> None:
    make(cell)
    text = "name;length;speed;gripper;fast;note\nHöhe;400;80,5;fork;WAHR;a\n"
    for encoding in ("utf-16", "cp1252"):
        content = text.replace("Höhe", f"Höhe {encoding}").encode(encoding)
        receipt = cell.http.post(
            "/recipes/boxes/import", content=content, headers={"content-type": "text/csv"}
        )
        assert receipt.json()["done"] is True, receipt.text
        assert exported(cell)[f"Höhe {encoding}"]["speed"] == "80.5"


def test_a_form_has_numbers_as_the_reader_writes_them(cell: Server) -> None:
    make(cell)
    fields = {"-recipe": "carton", "-version": "1", "length": "450", "speed": "60,5", "gripper": "fork"}
    german = FORM | {"accept-language": "de"}
    answer = cell.http.post(
        "/recipes/boxes/save", data=fields | {"fast": "true", "note": "x"}, headers=german
    )
    assert (answer.status_code, answer.headers["location"]) == (303, "/recipes/boxes?recipe=carton")
    assert exported(cell)["Carton"]["speed"] == "60.5"
    refused = cell.http.post(
        "/recipes/boxes/save", data=fields | {"fast": "true", "note": "x"}, headers=german
    )
    shown = cell.http.get(refused.headers["location"], headers={"accept-language": "de"}).text
    assert "wurde um" in shown


def test_paths_and_bodies_that_are_none_are_refused(cell: Server) -> None:
    assert cell.http.get("/recipes/none").status_code == 404
    assert cell.http.get("/recipes").headers["location"] == "/recipes/boxes"
    assert act(cell, "explode").status_code == 404
    assert act(cell, "save", recipe="carton").status_code == 422
    assert act(cell, "create", name="x").status_code == 422
    assert act(cell, "save", recipe="../../x", version=1, values=CARTON).json()["code"] == "recipe_gone"
    assert cell.http.post("/recipes/boxes/save", data={"odd": "1"}, headers=FORM).status_code == 422


def test_a_name_is_given_once_by_creates_at_the_same_time(cell: Server) -> None:
    def create(number: int) -> tuple[int, str]:
        values = {**CARTON, "note": str(number)}
        answer = act(cell, "create", name="Twin", values=values)
        return answer.status_code, answer.json()["code"]

    with ThreadPoolExecutor(8) as pool:
        answers = list(pool.map(create, range(8)))
    assert sorted(answers) == [(200, ""), *[(409, "recipe_name_taken")] * 7]
    assert [name for name in exported(cell) if name == "Twin"] == ["Twin"]


@pytest.mark.long("flood")
def test_an_import_may_have_4_mb_and_counts_its_rows(cell: Server) -> None:
    head = "name,length,speed,gripper,fast,note\n"
    row = "Carton %05d,400,80,fork,true," + "x" * 5 + "\n"
    rows = [row % number for number in range(3_900_000 // len(row % 0))]
    is_csv = {"content-type": "text/csv"}
    receipt = cell.http.post("/recipes/boxes/import", content=head + "".join(rows), headers=is_csv)
    assert receipt.status_code in (200, 409)
    assert f"Refused rows: {len(rows) - MAX_RECIPES}" in receipt.json()["reason"].replace(",", "")
    long = head + "x" * 4_000_001
    for content in (long, long * 4):
        answer = cell.http.post("/recipes/boxes/import", content=content, headers=is_csv)
        assert answer.status_code in (413, 422)
    assert cell.http.post("/recipes/boxes/create", content=b"{" * 100_000).status_code == 413

"""Recipes that the command line changes beside a running server, and while it is stopped: taken, and
logged as acts."""

import json
from pathlib import Path

import pytest

from app.cell.recipes.book import FOLDER
from app.cell.recipes.command_line import account
from app.tools.cli.log import main as log_main
from app.tools.cli.recipes import main
from tests.cell.recipes.panels import CARTON, PANEL, TRAY
from tests.support.parts import Server, until
from tests.web.test_recipes import act, entries, exported, load, make, server_with

HEAD = "name,length,speed,gripper,fast,note\n"


@pytest.fixture
def data(tmp_path: Path) -> Path:
    (tmp_path / "data").mkdir(mode=0o700)
    (tmp_path / "line.toml").write_text(PANEL)
    return tmp_path / "data"


def started(data: Path) -> Server:
    return server_with(data.parent, KIOSK_DATA=str(data))


def imported(data: Path, rows: str) -> int:
    """The exit status of an import by the command line."""
    file = data.parent / "boxes.csv"
    file.write_text(HEAD + rows)
    place = [str(data.parent / "line.toml"), "--data", str(data)]
    return main(["import", "boxes", str(file), *place, "--yes"])


def logged(server: Server) -> list[dict[str, str]]:
    """The entries of imports, the oldest first."""
    return [entry for entry in reversed(entries(server)) if entry["action"] == "recipe_import"]


def test_a_running_server_takes_an_import_and_logs_it(data: Path) -> None:
    with started(data) as server:
        make(server)
        assert imported(data, "Carton,450,80,vacuum,false,-\nTray,600,80,fork,true,x\n") == 0
        until(lambda: len(logged(server)) == 2, "both recipes are in the log")
        carton, tray = logged(server)
        assert (carton["kind"], carton["who"], carton["outcome"]) == ("recipe", account(), "succeeded")
        assert carton["reason"].startswith(f"Boxes: Carton imported by {account()} on the command line")
        assert carton["reason"].endswith("Length 400 mm → 450 mm.")
        assert "Gripper Fork" in tray["reason"]
        values = json.loads(carton["values"])
        assert (values["old"], values["new"]) == ({"length": 400}, {"length": 450})
        assert exported(server)["Carton"]["length"] == "450"
        refused = act(server, "save", recipe="carton", version=1, values=TRAY)
        assert (refused.status_code, refused.json()["code"]) == (409, "recipe_changed_since")
        assert load(server, "carton@2").json()["outcome"] == "confirmed"
        assert imported(data, "Carton,450,80,vacuum,false,-\n") == 0  # the same
        assert act(server, "save", recipe="carton", version=2, values=CARTON).json()["done"]
        assert len(logged(server)) == 2
    assert log_main(["verify", "--data", str(data)]) == 0


@pytest.mark.long("detail")
def test_an_import_while_the_server_is_stopped_is_logged_once_at_its_start(data: Path) -> None:
    assert imported(data, "Carton,450,80,vacuum,false,-\n") == 0
    for _ in range(2):
        with started(data) as server:
            until(lambda: logged(server), "it is in the log")
            assert [entry["who"] for entry in logged(server)] == [account()]
            assert exported(server)["Carton"]["length"] == "450"
    assert log_main(["verify", "--data", str(data)]) == 0


@pytest.mark.long("detail")
def test_a_change_that_was_cut_off_is_not_logged(data: Path) -> None:
    assert imported(data, "Carton,450,80,vacuum,false,-\n") == 0
    (data / FOLDER / "boxes" / "carton.toml").unlink()  # its process ended before it was written
    assert imported(data, "Tray,600,80,fork,true,x\n") == 0
    with started(data) as server:
        until(lambda: logged(server), "it is in the log")
        assert ["Tray" in entry["reason"] for entry in logged(server)] == [True]

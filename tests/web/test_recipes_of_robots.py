"""Recipes of a panel with several robots: a set is of the robots of its inputs, or of every robot."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from app.panel import load_panel
from app.panel.robot_panels import panel_of
from tests.cell.recipes.panels import CARTON, PANEL
from tests.support.parts import Server, until
from tests.support.servers import demo_server, panel_file

ROBOTS = """
[[robot]]
id = "left"
name = "Left arm"
namespace = "/left"
[[robot]]
id = "right"
name = "Right arm"
namespace = "/right"
"""
FORCES = """
[[page]]
id = "side"
title = "Right side"
robot = "right"
[[page.widget]]
id = "force"
kind = "number"
label = "Force"
min = 0
max = 50
[[recipe]]
id = "forces"
label = "Forces"
fields = ["force"]
topic = "/force"
type = "std_msgs/msg/Float64"
message = { data = "{force}" }
"""


@pytest.fixture
def cell(tmp_path: Path) -> Iterator[Server]:
    with demo_server(tmp_path, PANEL + ROBOTS + FORCES) as server:
        yield server


def test_a_set_is_of_the_robots_of_its_inputs(tmp_path: Path) -> None:
    panel = load_panel(panel_file(tmp_path, PANEL + ROBOTS + FORCES))
    sets = {name: [r.id for r in panel_of(panel, name).recipes] for name in ("left", "right")}
    assert sets == {"left": ["boxes"], "right": ["boxes", "forces"]}
    assert [load.id for load in panel_of(panel, "left").recipe_loads] == ["boxes"]
    plain = load_panel(panel_file(tmp_path, PANEL + ROBOTS))
    assert panel_of(plain, "left") is plain


def test_a_recipe_is_loaded_into_the_robot_of_the_page(cell: Server) -> None:
    cell.http.post("/robots/left/recipes/boxes/create", json={"name": "Carton", "values": CARTON})
    until(lambda: load(cell, "right", "boxes", "carton@1")["outcome"] == "confirmed", "it is loaded")
    until(lambda: "values differ" in page(cell, "left", "boxes"), "the left robot's are read")
    assert "The robot has these values" in page(cell, "right", "boxes")
    assert "The robot has these values" not in page(cell, "left", "boxes")


def test_recipes_of_one_robot_are_on_its_page_only(cell: Server) -> None:
    assert cell.http.get("/robots/left/recipes").headers["location"] == "/robots/left/recipes/boxes"
    moved = cell.http.get("/robots/left/recipes/forces")
    assert (moved.status_code, moved.headers["location"]) == (303, "/robots/right/recipes/forces")
    assert "Forces" not in page(cell, "left", "boxes")
    assert "Forces" in page(cell, "right", "boxes")
    body = {"name": "Soft", "values": {"force": 20}}
    assert cell.http.post("/robots/right/recipes/forces/create", json=body).json()["done"]
    assert cell.http.post("/robots/left/widgets/forces", json={}).status_code == 404
    assert load(cell, "right", "forces", "soft@1")["outcome"] == "published"
    form = {"forces": "soft@1"}
    assert cell.http.post("/robots/right/widgets/forces", data=form).status_code == 422  # needs scripts


def load(server: Server, robot: str, set_id: str, recipe: str) -> dict[str, str]:
    answer = server.http.post(f"/robots/{robot}/widgets/{set_id}", json={"inputs": {set_id: recipe}})
    receipt: dict[str, str] = answer.json()
    return receipt


def page(server: Server, robot: str, set_id: str) -> str:
    answer = server.http.get(f"/robots/{robot}/recipes/{set_id}", params={"recipe": "carton"})
    assert answer.status_code == 200, answer.text
    return answer.text.partition("<main")[2]

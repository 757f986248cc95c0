"""The simulated robot reports the recipe that was loaded into it, so that it is read back."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import pytest

from app.panel import load_panel
from tests.bridge.test_recipes_on_bridge import BOX, OF_NODES_SERVICE, OF_TOPIC
from tests.support.servers import demo_server
from tests.support.stepped import Stepped

BY_PARAMETERS: Final = """
[recipe.readback]
node = "/wrapper"
parameters = { length = "length", speed = "speed" }
parameter_types = { length = "double" }
"""
WRAP: Final = {"program": "wrap", "layers": 6}
Loaded = Callable[[str], Stepped]


def demo(panel: str) -> str:
    return panel.replace('mode = "live"', 'mode = "demo"\nlanguage = "en"')


@pytest.fixture
def stepped(tmp_path: Path) -> Loaded:
    def robot(panel: str) -> Stepped:
        (tmp_path / "cell.toml").write_text(demo(panel))
        return Stepped(load_panel(tmp_path / "cell.toml"))

    return robot


def test_a_message_with_a_recipe_is_reported_from_then_on(stepped: Loaded) -> None:
    robot = stepped(OF_TOPIC).run(2)
    robot.hear("/test_recipe", x=0.4, y=80.0)
    robot.run(5)
    for field, value in (("x", 0.4), ("y", 80.0)):
        assert robot.values("/test_recipe_now", field)[-1] == value
    robot.hear("/test_recipe", x=0.5, y=60.0)
    assert robot.run(2).values("/test_recipe_now", "y")[-1] == 60.0


def test_a_request_with_a_recipe_is_reported_and_another_one_is_not(stepped: Loaded) -> None:
    robot = stepped(OF_NODES_SERVICE).run(2)
    robot.call("/load_program", prefixes=["wrap"], depth=6)
    assert robot.run(2).values("/program_now", "line")[-1] == 6
    assert robot.values("/program_now", "name")[-1] == "wrap"
    robot.call("/load_program", prefixes=["a", "b"], depth=9)  # no request of the recipe
    assert robot.run(2).values("/program_now", "line")[-1] == 6


def test_parameters_that_are_read_back_have_what_a_message_set(stepped: Loaded) -> None:
    robot = stepped(OF_TOPIC.partition("[recipe.readback]")[0] + BY_PARAMETERS).run(1)
    robot.hear("/test_recipe", x=0.4, y=80.0)
    answer = robot.call("/wrapper/get_parameters", names=["length", "speed"])
    assert [value.double_value for value in answer.values] == [0.4, 80.0]


@pytest.mark.parametrize(
    ("panel", "set_id", "values"),
    [(OF_TOPIC, "boxes", BOX), (OF_NODES_SERVICE, "programs", WRAP)],
)
def test_a_load_in_the_demo_is_read_back(
    tmp_path: Path, panel: str, set_id: str, values: dict[str, Any]
) -> None:
    with demo_server(tmp_path, demo(panel)) as server:
        made = server.http.post(f"/recipes/{set_id}/create", json={"name": "A", "values": values})
        assert made.json()["done"], made.text
        press = {"inputs": {set_id: "a@1"}}
        receipt = server.http.post(f"/widgets/{set_id}", json=press).json()
        assert (receipt["outcome"], receipt["code"]) == ("confirmed", "recipe_loaded"), receipt

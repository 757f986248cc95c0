"""What the robot reports, and which recipe that is: nothing is claimed that is not known."""

from pathlib import Path
from typing import Any, Final

import pytest

from app.cell.recipes.recipe import Recipe, new_recipe, reported_text, value_text
from app.cell.recipes.reported import differing, is_same, loaded, reported_fields
from app.cell.robot.state import RobotState
from app.panel import Panel, load_panel
from app.panel.file.load import faults_of_text
from app.ros.zenoh.sample import Sample
from app.system.texts import render
from tests.cell.recipes.panels import CARTON, INPUTS, TRAY, load_of
from tests.support.builders import BRIDGE, INTERFACES, NOW, endpoint, robot_there

VECTOR: Final = "geometry_msgs/msg/Vector3"
PANEL: Final = f"""title = "Cell"
{INPUTS}
[[recipe]]
id = "boxes"
label = "Boxes"
fields = ["length", "speed"]
topic = "/load"
type = "{VECTOR}"
message = {{ x = "{{length}}", y = "{{speed}}" }}
[recipe.readback]
topic = "/now"
type = "{VECTOR}"
fields = {{ length = "x", speed = "y" }}
max_age_s = 2.0
"""


@pytest.mark.parametrize(
    ("field", "type_name", "path", "words"),
    [
        ("length", "std_msgs/msg/String", "data", '"data" is string: "length" is a number'),
        ("length", "std_msgs/msg/Bool", "data", '"data" is bool: "length" is a number'),
        ("length", "std_msgs/msg/Int32", "data", ""),
        ("length", VECTOR, "x", ""),
        ("fast", "std_msgs/msg/Int32", "data", '"fast" is a bool'),
        ("fast", "std_msgs/msg/Bool", "data", ""),
        ("note", "std_msgs/msg/Bool", "data", '"note" is a text'),
        ("note", "std_msgs/msg/String", "data", ""),
        ("gripper", "std_msgs/msg/Float64", "data", '"gripper" is a text'),
        ("gripper", "std_msgs/msg/String", "data", ""),
    ],
)
def test_what_is_read_back_has_the_type_of_its_input(
    tmp_path: Path, field: str, type_name: str, path: str, words: str
) -> None:
    text = f"""title = "Cell"
{INPUTS}
[[recipe]]
id = "boxes"
label = "Boxes"
fields = ["{field}"]
node = "/palletizer"
parameters = {{ {field} = "x" }}
[recipe.readback]
topic = "/now"
type = "{type_name}"
fields = {{ {field} = "{path}" }}
"""
    faults = [(fault.place, fault.message) for fault in faults_of_text(text, tmp_path)]
    if not words:
        assert faults == []
        return
    ((place, message),) = faults
    assert place == f"recipe[0].readback.fields.{field}"
    assert words in message


class Cell:
    """A robot that reports by a topic."""

    def __init__(self, folder: Path) -> None:
        path = folder / "cell.toml"
        path.write_text(PANEL)
        self.panel: Panel = load_panel(path)
        self.load = self.panel.recipe_loads[0]
        self.robot: RobotState = robot_there(self.panel)
        endpoint(self.robot, "MP", "/now", VECTOR)

    def reports(self, length: float, speed: float, at: float = NOW) -> None:
        payload = INTERFACES.encode(VECTOR, {"x": length, "y": speed, "z": 0.0})
        self.robot.update(self.robot.key("/now"), Sample(payload, 1, at, at, BRIDGE))

    def loaded(self, *recipes: Recipe, now: float = NOW) -> Any:
        return loaded(self.load.fields, recipes, reported_fields(self.load, self.robot, now))


@pytest.fixture
def cell(tmp_path: Path) -> Cell:
    return Cell(tmp_path)


def recipe(name: str, **values: Any) -> Recipe:
    return new_recipe(name, "created", 0.0, "Ann", name, CARTON | values)


CARTON_RECIPE, OTHER = recipe("carton"), recipe("other", length=500)


def test_a_recipe_is_in_the_robot_if_every_value_is_reported(cell: Cell) -> None:
    assert cell.loaded(CARTON_RECIPE) is None
    cell.reports(0.4, 80.0)
    assert cell.loaded(CARTON_RECIPE, OTHER) == ("carton",)
    cell.reports(0.4, 80.5)
    assert cell.loaded(CARTON_RECIPE, OTHER) == ()
    cell.reports(0.5, 80.0)
    assert cell.loaded(CARTON_RECIPE, OTHER) == ("other",)


def test_an_old_report_claims_nothing(cell: Cell) -> None:
    cell.reports(0.4, 80.0)
    assert cell.loaded(CARTON_RECIPE, now=NOW + 1.9) == ("carton",)
    assert cell.loaded(CARTON_RECIPE, now=NOW + 2.0) is None
    fields = reported_fields(cell.load, cell.robot, NOW)
    assert {field.until for field in fields.values()} == {NOW + 2.0}


def test_a_robot_that_is_cut_off_claims_nothing(cell: Cell) -> None:
    cell.reports(0.4, 80.0)
    cell.robot.link_up = False
    assert cell.loaded(CARTON_RECIPE) is None
    why = reported_fields(cell.load, cell.robot, NOW)["length"].why
    assert render(why)


def test_no_number_is_no_report(cell: Cell) -> None:
    cell.reports(float("nan"), 80.0)
    assert cell.loaded(CARTON_RECIPE) is None


def test_parameters_that_no_node_has_answered_for_are_not_known(tmp_path: Path) -> None:
    load = load_of(tmp_path)
    panel = load_panel(tmp_path / "cell.toml")
    fields = reported_fields(load, robot_there(panel), NOW)
    assert not any(field.is_known for field in fields.values())


def test_a_value_that_is_missing_or_differs_is_named(cell: Cell) -> None:
    cell.reports(0.4, 70.0)
    fields = reported_fields(cell.load, cell.robot, NOW)
    assert [f.id for f in differing(cell.load.fields, CARTON, fields)] == ["speed"]
    assert [f.id for f in differing(cell.load.fields, {"speed": 70.0}, fields)] == ["length"]


def test_values_are_compared_and_shown_in_the_operators_unit(tmp_path: Path) -> None:
    length, speed, gripper, fast, note = load_of(tmp_path).fields
    assert is_same(length, 400, 0.4)
    assert is_same(length, 400, 0.4000000059604645)  # a float32
    assert not is_same(length, 400, 0.401)
    assert render(reported_text(length, 0.4000000059604645)) == "400 mm"
    assert render(reported_text(speed, 33.25)) == "33.25 %"
    assert render(value_text(gripper, "fork")) == "Fork"
    assert render(value_text(fast, True)) == "On"
    assert render(value_text(note, "x")) == "x"
    assert render(value_text(note, None)) == "—"
    assert not is_same(fast, True, 1)
    assert is_same(gripper, TRAY["gripper"], "fork")

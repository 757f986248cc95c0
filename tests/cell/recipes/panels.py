"""A panel with recipes whose values are parameters of a node."""

from pathlib import Path
from typing import Any, Final

from app.panel import load_panel
from app.panel.widgets.recipe_load import RecipeLoad

INPUTS: Final = """
[[page]]
id = "main"
title = "Main"
[[page.widget]]
id = "length"
kind = "number"
label = { en = "Length", de = "Länge" }
unit = "mm"
send_unit = "m"
min = 300
max = 600
default = 400
[[page.widget]]
id = "speed"
kind = "number"
label = "Speed"
unit = "%"
min = 10.0
max = 100.0
default = 80.0
[[page.widget]]
id = "gripper"
kind = "select"
label = "Gripper"
options = [{ value = "vacuum", label = "Vacuum" }, { value = "fork", label = "Fork" }]
[[page.widget]]
id = "fast"
kind = "toggle"
label = "Fast"
[[page.widget]]
id = "note"
kind = "text"
label = "Note"
max_length = 10
"""
SET: Final = """
[[recipe]]
id = "boxes"
label = "Boxes"
fields = ["length", "speed", "gripper", "fast", "note"]
node = "/palletizer"
confirm_s = 8.0
[recipe.parameters]
length = "box.length"
speed = "arm.speed"
gripper = "gripper"
fast = "fast"
note = "note"
[demo."/palletizer"]
parameters = { "box.length" = 0.4, "arm.speed" = 100, gripper = "vacuum", fast = false, note = "-" }
"""
PANEL: Final = f'title = "Cell"\nlanguage = "en"\n{INPUTS}{SET}'
CARTON: Final[dict[str, Any]] = {
    "length": 400,
    "speed": 80.0,
    "gripper": "vacuum",
    "fast": False,
    "note": "-",
}
TRAY: Final[dict[str, Any]] = {**CARTON, "length": 600, "gripper": "fork", "fast": True, "note": "x"}


def load_of(folder: Path, panel: str = PANEL) -> RecipeLoad:
    """The load of the first set of a panel."""
    path = folder / "cell.toml"
    path.write_text(panel)
    return load_panel(path).recipe_loads[0]

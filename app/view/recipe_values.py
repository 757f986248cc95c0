"""What the page of recipes shows of the robot: pure, from (the load of a set, robot, time)."""

import hashlib
import json
from typing import Any

from app.panel.widgets.recipe_load import RecipeLoad
from app.recipes.reported import reported_fields
from app.robot.state import RobotState


def recipe(widget: RecipeLoad, robot: RobotState, now: float) -> tuple[dict[str, Any], float]:
    """Attributes of the load of a set: `reported` changes with what the robot has, or is known to have.
    And when they change by time."""
    fields = reported_fields(widget, robot, now)
    known = {name: (field.value, str(field.why)) for name, field in fields.items()}
    text = json.dumps(known, default=str)
    until = min(field.until for field in fields.values())
    return {"reported": hashlib.sha256(text.encode()).hexdigest()[:16]}, until

"""Conditions and readouts of functions of fields: what is unknown locks, with its reason."""

import math
from typing import Any, Final

from app.cell.permission.interlocks import interlock_verdict
from app.cell.robot.state import Sample
from app.cell.view.view import build_view
from tests.support.builders import (
    BRIDGE,
    ENABLED,
    HEARD,
    INTERFACES,
    NOW,
    Table,
    endpoint,
    panel_of,
    robot_there,
)
from tests.support.words import english

SCAN: Final = "sensor_msgs/msg/LaserScan"
NEAREST: Final[Table] = {"type": SCAN, "field": "min(ranges)"}


class Cell:
    def __init__(self, **interlock: Any) -> None:
        shown = {**HEARD, "topic": ENABLED, **NEAREST, "unit": "m"}
        self.panel = panel_of(shown, interlock={**NEAREST, "min": 0.5, "max_age_s": 1.0, **interlock})
        self.robot = robot_there(self.panel)
        endpoint(self.robot, "MP", ENABLED, SCAN)

    def says(self, *ranges: float) -> None:
        payload = INTERFACES.encode(SCAN, {"ranges": ranges})
        self.robot.update(self.robot.key(ENABLED), Sample(payload, 1, NOW, NOW, BRIDGE))

    def reason(self) -> str:
        return str(english(interlock_verdict(self.panel.interlocks[0], self.robot, NOW).reason))

    def code(self) -> str:
        return interlock_verdict(self.panel.interlocks[0], self.robot, NOW).code

    def shown(self) -> Any:
        return english(build_view(self.panel, self.robot, NOW).view["widgets"]["heard"])


def test_the_nearest_point_of_a_scan_permits_and_locks() -> None:
    cell = Cell()
    cell.says(2.0, 0.75)
    assert (cell.code(), cell.shown()["text"]) == ("permitted", "0.75 m")
    cell.says(2.0, 0.25)
    assert cell.code() == "interlock_condition_unmet"


def test_an_empty_scan_locks_and_is_shown_with_its_reason() -> None:
    cell = Cell()
    cell.says()
    assert cell.code() == "interlock_field_no_value"
    assert cell.reason().endswith(
        "min(ranges) of the last /operation_enabled has no value: the list is empty."
    )
    assert cell.shown()["text"] == "—"
    assert "the list is empty" in cell.shown()["note"]


def test_a_scan_with_a_number_that_is_none_locks() -> None:
    cell = Cell()
    cell.says(2.0, math.nan)
    assert cell.code() == "interlock_condition_unmet"
    assert cell.shown()["text"] == "NaN m"

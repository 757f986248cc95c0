"""Known numbers are sentences in the reader's language: states of a battery, error codes of Nav2."""

from typing import Any, Final

import pytest

from app.cell.commands.goals import RESULT
from app.cell.commands.services import with_fields
from app.cell.view.displays import readout
from app.panel.known_values import KNOWN_VALUES, NAV2_ERRORS, OWN_ERRORS, known_value
from app.panel.widgets.displays import Readout
from app.ros.messages import Fields
from app.ros.zenoh.sample import Sample
from app.system.texts import Text, render, say
from app.system.texts.catalogue import files
from tests.support.builders import BRIDGE, INTERFACES, NOW, panel_of, robot_there

BATTERY: Final = "sensor_msgs/msg/BatteryState"
GO: Final = "nav2_msgs/action/NavigateToPose"
FOLLOW: Final = "nav2_msgs/action/FollowObject"


@pytest.mark.parametrize("codes", [*KNOWN_VALUES.values(), NAV2_ERRORS, *OWN_ERRORS.values()])
def test_each_has_a_sentence_in_each_language(codes: dict[int, str]) -> None:
    for code in codes.values():
        for language in files():
            assert render(say(code, error="1"), language) not in ("", code)


@pytest.mark.parametrize(
    ("kind", "field", "value", "codes"),
    [
        (BATTERY, "power_supply_status", 1, ["battery_charging"]),
        (BATTERY, "power_supply_status", 4, ["battery_full"]),
        (BATTERY, "power_supply_status", 9, None),  # not a status
        (BATTERY, "power_supply_technology", 1, None),
        (BATTERY, "percentage", 1.0, None),
        (GO, "error_code", 0, None),
        (GO, "error_code", 206, ["nav2_goal_occupied"]),  # passed on by its planner
        (GO, "error_code", 904, ["nav2_dock_not_seen"]),
        (GO, "error_code", 5000, None),
        (GO, "error_code", True, None),
        (FOLLOW, "error_code", 901, ["nav2_no_transform"]),
        ("my_msgs/action/Drive", "error_code", 206, None),
    ],
)
def test_what_is_known(kind: str, field: str, value: Any, codes: list[str] | None) -> None:
    text = known_value(kind, field, value)
    parts = dict(text.params).values() if text else ()
    said = [part.code for part in (text, *parts) if isinstance(part, Text)]
    assert said == (codes or [])


def test_a_result_names_the_error_beside_other_fields() -> None:
    fields = Fields({f"{RESULT}error_code": 206, f"{RESULT}error_msg": "goal in lethal space"})
    text = with_fields("{error_msg}. {error_code}", fields, RESULT, kind=GO)
    assert render(text, "en").startswith("goal in lethal space. Something stands at the goal (206).")
    assert render(text, "de").startswith("goal in lethal space. Am Ziel steht etwas (206).")


def test_a_format_shows_the_number() -> None:
    assert render(with_fields("{error_code:d}", Fields({"error_code": 206}), kind=GO), "en") == "206"


@pytest.mark.parametrize(
    ("keys", "text"),
    [({}, "Full"), ({"constants": "POWER_SUPPLY_STATUS_"}, "FULL"), ({"format": "d"}, "4")],
)
def test_a_readout_says_what_a_battery_does(keys: dict[str, Any], text: str) -> None:
    source = {"topic": "/battery", "type": BATTERY, "field": "power_supply_status"}
    panel = panel_of({"id": "supply", "kind": "readout", "label": "Supply", **source, **keys})
    robot = robot_there(panel)
    robot.update(
        "battery", Sample(INTERFACES.encode(BATTERY, {"power_supply_status": 4}), 1, NOW, NOW, BRIDGE)
    )
    shown, _ = readout(panel.widget("supply", Readout), robot, NOW)
    assert render(shown["text"], "en") == text

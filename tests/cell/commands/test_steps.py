"""Steps: made from the value that the robot reports, one at a time, and only where that is known."""

import asyncio
import itertools
from typing import Any, Final

import pytest

from app.cell.commands.confirmations import Confirmations
from app.cell.commands.receipts import Receipt
from app.cell.permission.press_permission import judged
from app.cell.robot.state import RobotState
from app.cell.view.view import build_view
from app.panel import load_panel
from app.panel.model import Panel
from app.panel.widgets.publish import Step
from app.system.errors import PanelError
from app.system.texts import TextLike, number, say
from tests.cell.commands.test_presses import Way
from tests.support.builders import (
    INTERFACES,
    faults_text,
    panel_of,
    press_widget,
    presses_of,
    robot_there,
    says,
)
from tests.support.words import coded, english

FLOAT: Final = "std_msgs/msg/Float32"
FLOATS: Final = "std_msgs/msg/Float32MultiArray"
STEP: Final = {
    "id": "speed",
    "kind": "step",
    "label": "Speed",
    "topic": "/set_speed",
    "type": FLOAT,
    "message": {"data": "{value}"},
    "value": {"topic": "/speed", "type": FLOAT, "max_age_s": 5.0},
    "min": 0,
    "max": 100,
    "step": 10,
    "unit": "mm/s",
    "within_s": 0.2,
}


class Desk:
    """Presses on a robot that reports its speed."""

    def __init__(self, **more: Any) -> None:
        self.now = 100.0
        self.panel: Panel = panel_of({**STEP, **more})
        self.robot: RobotState = robot_there(self.panel)
        self.way = Way()
        self.confirmations = Confirmations(self.robot, lambda _: None)
        self.presses = presses_of(
            self.panel,
            self.robot,
            self.way,
            confirmations=self.confirmations,
            monotonic=lambda: self.now,
        )
        self._seq = itertools.count(1)

    def reports(self, speed: float) -> None:
        says(self.robot, "/speed", speed, FLOAT, at=self.now, seq=next(self._seq))
        self.confirmations.update(self.robot.key("/speed"), self.robot.reading("/speed"))

    def shown(self) -> Any:
        return english(build_view(self.panel, self.robot, self.now).view["widgets"]["speed"])

    def reason(self) -> TextLike | None:
        """Why no step can be made."""
        step = next(w for w in self.panel.commands if isinstance(w, Step))
        return judged(step, (), self.robot, self.now).reason

    def press(self, value: Any, press_id: str = "p1") -> Receipt:
        return asyncio.run(press_widget(self.presses, "speed", {"speed": value}, press_id))

    def sent(self) -> list[float]:
        return [INTERFACES.decode(FLOAT, payload).data for _, payload in self.way.sent]


def test_step_buttons_have_the_values_next_to_the_reported_value() -> None:
    desk = Desk()
    desk.reports(40.0)
    view = desk.shown()
    assert (view["enabled"], view["text"]) == (True, "40")
    assert (view["step_down"], view["step_up"]) == ("30", "50")


@pytest.mark.parametrize(
    ("speed", "down", "up"),
    [(0.0, "", "10"), (4.0, "0", "14"), (95.0, "85", "100"), (100.0, "90", ""), (0.1, "0", "10.1")],
)
def test_steps_end_at_the_limits(speed: float, down: str, up: str) -> None:
    desk = Desk()
    desk.reports(speed)
    assert (desk.shown()["step_down"], desk.shown()["step_up"]) == (down, up)


def test_step_without_a_known_value_is_locked_with_a_reason() -> None:
    desk = Desk()
    assert desk.shown()["enabled"] is False
    assert desk.reason() == say("interlock_waiting", topic="Speed", wanted=FLOAT)
    assert desk.shown()["reason"] == str(desk.reason())
    assert (desk.shown()["step_down"], desk.shown()["step_up"]) == ("", "")
    desk.reports(float("nan"))
    nan = say("condition_nan")
    assert desk.reason() == say("interlock_not_a_number", topic="Speed", field="data", value=nan)
    assert desk.shown()["note"] == "the value is not a number (NaN)"
    desk.reports(120.0)
    assert coded(desk.reason(), "value", "low", "high") == (
        "step_value_outside_limits",
        "120",
        "0",
        "100",
    )
    desk.reports(40.0)
    step = next(w for w in desk.panel.commands if isinstance(w, Step))
    assert judged(step, (), desk.robot, desk.now).until == desk.now + 5
    desk.now += 6
    assert desk.reason() == say("interlock_stale", topic="Speed", limit=number("5"))
    assert desk.press(50).outcome == "refused"
    assert desk.sent() == []


@pytest.mark.parametrize("speed", [0.0, 100.0])
def test_step_at_a_limit_is_not_locked_and_a_value_without_an_age_stays(speed: float) -> None:
    desk = Desk(value={"topic": "/speed", "type": FLOAT})
    desk.reports(speed)
    desk.now += 1e6
    assert desk.reason() is None
    assert desk.shown()["enabled"]


def test_step_locks_if_its_value_is_missing_in_the_message() -> None:
    source = {"topic": "/speeds", "type": FLOATS, "field": "data[1]"}
    desk = Desk(value=source)
    says(desk.robot, "/speeds", [40.0], FLOATS, at=desk.now)
    assert desk.reason() == say("interlock_field_missing", topic="Speed", field="data[1]")


def test_a_press_publishes_the_value_that_was_shown_and_waits_until_it_is_reported() -> None:
    async def pressed(desk: Desk) -> tuple[Receipt, Receipt]:
        first = asyncio.create_task(press_widget(desk.presses, "speed", {"speed": 50}, "p1"))
        while not desk.sent():
            await asyncio.sleep(0)
        assert (desk.shown()["enabled"], desk.reason()) == (False, say("press_in_progress"))
        second = await press_widget(desk.presses, "speed", {"speed": 50}, "p2")
        desk.reports(50.0)
        return await first, second

    desk = Desk()
    desk.reports(40.0)
    first, second = asyncio.run(pressed(desk))
    assert (first.outcome, second.outcome) == ("confirmed", "refused")
    assert desk.sent() == [50.0]
    assert (desk.shown()["step_down"], desk.shown()["step_up"]) == ("40", "60")


@pytest.mark.parametrize("entered", [40, 41, 60, "50", None, True])
def test_a_press_that_is_no_step_from_the_reported_value_sends_nothing(entered: Any) -> None:
    desk = Desk()
    desk.reports(40.0)
    receipt = desk.press(entered)
    assert receipt.outcome == "refused"
    assert coded(receipt.reason, "label", "value") == ("step_value_changed", "Speed", "40")
    assert desk.sent() == []


def test_the_value_stands_in_a_text_too_and_as_a_whole_number() -> None:
    text = "std_msgs/msg/String"
    desk = Desk(type=text, message={"data": "speed={value}"})
    desk.reports(40.0)
    desk.press(50)
    ((_, payload),) = desk.way.sent
    assert INTERFACES.decode(text, payload).data == "speed=50"


def test_faults_of_a_step_are_reported(tmp_path: Any) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(
        'title = "T"\n[[page]]\nid = "p"\ntitle = "P"\n[[page.widget]]\nid = "speed"\nkind = "step"\n'
        'label = "Speed"\ntopic = "/a"\ntype = "std_msgs/msg/UInt8"\nmessage = { data = "{value}" }\n'
        'value = { topic = "/b", type = "std_msgs/msg/UInt8" }\nmin = 0\nmax = 300\nstep = 10\n'
    )
    with pytest.raises(PanelError) as caught:
        load_panel(path)
    assert 'message.data: input "speed" gives 300; the field is uint8' in faults_text(caught.value)

"""The palletizing cell as the robot of a panel: its topics, commands and action."""

from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Final

import pytest

from app.panel import load_panel
from app.panel.demo import PALLETIZING
from app.ros.messages.names import Qos
from app.tools.simulator.palletizing import BOXES, CYCLE_S, DOOR_OPEN, OUT_S, REFUSED, State
from app.tools.simulator.robot import CANCEL_OK, CANCEL_UNKNOWN, CANCELED, EXECUTING, SUCCEEDED
from tests.support.stepped import Stepped

ABORTED: Final = 6
OUT: Final = "/pallet_out"
GOAL: Final = SimpleNamespace(order=1)
HEAD: Final = """title = "Cell"
mode = "demo"
demo_story = "palletizing"
[[page]]
id = "one"
title = "One"
"""
FIELDS: Final = {
    "sensor_msgs/msg/FluidPressure": "fluid_pressure",
    "sensor_msgs/msg/Temperature": "temperature",
    "sensor_msgs/msg/JointState": "position[name=joint_1]",
    "diagnostic_msgs/msg/DiagnosticArray": "status[name=Arm].message",
}


def widget(number: int, kind: str, **keys: str) -> str:
    lines = "".join(f"{key} = {value}\n" for key, value in keys.items())
    return f'[[page.widget]]\nid = "w{number}"\nkind = "{kind}"\nlabel = "W"\n{lines}'


def widgets() -> Iterator[str]:
    """A widget for each name of the story."""
    shown = (topic for topic in PALLETIZING.publishes.items() if topic[0] != "/rosout")
    for number, (topic, kind) in enumerate(shown):
        field = FIELDS.get(kind, "data")
        keys = {"topic": topic, "type": kind, "field": field}
        yield widget(number, "readout", **{key: f'"{value}"' for key, value in keys.items()})
    yield widget(100, "log")
    for number, (topic, kind) in enumerate(PALLETIZING.subscribes.items(), 200):
        yield widget(number, "publish", topic=f'"{topic}"', type=f'"{kind}"', message="{}")
    for number, (service, kind) in enumerate(PALLETIZING.services.items(), 300):
        yield widget(number, "call", service=f'"{service}"', type=f'"{kind}"')
    for number, (action, kind) in enumerate(PALLETIZING.actions.items(), 400):
        yield widget(number, "action", action=f'"{action}"', type=f'"{kind}"')


PANEL: Final = HEAD + "".join(widgets())


@pytest.fixture
def stepped(tmp_path: Path) -> Callable[..., Stepped]:
    def load(panel: str = PANEL) -> Stepped:
        path = tmp_path / "cell.toml"
        path.write_text(panel)
        return Stepped(load_panel(path))

    return load


@pytest.fixture
def robot(stepped: Callable[..., Stepped]) -> Stepped:
    return stepped().run(1)


def newest(robot: Stepped, topic: str, field: str = "data") -> Any:
    reader = robot.interfaces.field_reader(robot.robot.publishes[topic].type, [field])
    return reader.read(robot.said[topic][-1][1]).get(field)


def run_until(robot: Stepped, topic: str, value: Any, within_s: float) -> None:
    steps = round(within_s / 0.1)
    assert any(newest(robot.run(0.1), topic) == value for _ in range(steps)), f"{topic} is not {value}"


def fill_pallet(robot: Stepped) -> None:
    """With a visitor who clears the faults on the way."""
    for _ in range(BOXES):
        answer(robot, "/reset")
        answer(robot, "/cell/start")
        if newest(robot.run(CYCLE_S), "/cell/reason") == "PALLET_FULL":
            return
    raise AssertionError("the pallet is not full")


def answer(robot: Stepped, service: str, **fields: Any) -> tuple[bool, str]:
    response = robot.call(service, **fields)
    return response.success, response.message


def test_every_name_of_the_story_is_played_with_its_type(robot: Stepped) -> None:
    robot.run(5)
    assert set(PALLETIZING.publishes) <= set(robot.said)
    published = robot.robot.publishes
    assert {name: published[name].type for name in PALLETIZING.publishes} == PALLETIZING.publishes
    assert PALLETIZING.subscribes.keys() <= robot.robot.subscribes.keys()
    assert PALLETIZING.services.items() <= robot.robot.services.items()
    assert robot.robot.actions[OUT].type == PALLETIZING.actions[OUT]


def test_states_are_there_for_late_subscribers(robot: Stepped) -> None:
    published = robot.robot.publishes
    assert published["/cell/state"].qos.transient_local
    assert published["/air_pressure"].qos == Qos()


def test_unchanged_state_is_published_each_second_and_a_change_at_once(robot: Stepped) -> None:
    times = [at for at, _ in robot.run(9).timed("/cell/state")]
    assert len(times) == pytest.approx(10, abs=1)
    robot.hear("/cell/stop")
    robot.run(0.1)
    assert newest(robot, "/cell/state") == "STOPPED"


def test_shown_values_belong_to_one_moment(robot: Stepped) -> None:
    robot.run(20)
    boxes, pallet = newest(robot, "/boxes"), newest(robot, "/cell/pallet")
    assert newest(robot, "/cell/shift_boxes") == (pallet - 1) * BOXES + boxes
    assert newest(robot, "/cell/layer") == boxes // 24 + 1
    left = (BOXES - boxes) * newest(robot, "/cell/last_cycle") / 60
    assert newest(robot, "/cell/minutes_left") == pytest.approx(left, abs=0.1)
    assert newest(robot, "/diagnostics", "status[name=Arm].message") == "moves"


def test_the_door_locks_stops_and_is_cleared_by_the_steps(robot: Stepped) -> None:
    assert answer(robot, "/cell/guard_door", data=True) == (True, "")
    robot.run(0.2)
    assert newest(robot, "/cell/state") == "FAULT"
    assert newest(robot, "/cell/reason") == "GUARD_DOOR"
    for topic in ("/guard_locked", "/operation_enabled", "/cell/moving", "/cell/no_fault"):
        assert newest(robot, topic) is False
    boxes = newest(robot, "/boxes")
    assert answer(robot, "/reset") == (False, DOOR_OPEN)
    assert answer(robot, "/cell/start") == (False, REFUSED[State.FAULT])
    assert newest(robot.run(10), "/boxes") == boxes
    answer(robot, "/cell/guard_door", data=False)
    robot.run(0.2)
    assert newest(robot, "/cell/reset_permitted") is True
    assert answer(robot, "/reset") == (True, "")
    robot.run(0.2)
    assert newest(robot, "/cell/start_permitted") is True
    assert answer(robot, "/cell/start") == (True, "")
    run_until(robot, "/boxes", boxes + 1, CYCLE_S)
    assert "guard door 1 opened" in robot.values("/rosout", "msg")


def test_commands_by_topic_and_service_have_their_effects(robot: Stepped) -> None:
    assert answer(robot, "/light", data=True) == (True, "")
    run_until(robot, "/cell/light", True, 1)
    assert answer(robot, "/cell/pause") == (True, "")
    run_until(robot, "/cell/state", "PAUSED", 2 * CYCLE_S)
    robot.hear("/cell/recipe", data="600 x 400; 6; true; 210; 4712 B; rush")
    robot.hear("/cell/belt_jog", data=-1.0)
    robot.run(0.2)
    assert newest(robot, "/cell/next_order") == "4712 B; rush"
    assert newest(robot, "/cell/mode") == "MANUAL"
    assert newest(robot, "/cell/belt_speed") == -120
    robot.hear("/cell/belt_jog", data=0.0)
    robot.run(0.2)
    assert newest(robot, "/cell/state") == "PAUSED"


def test_a_full_pallet_goes_out_by_the_action(robot: Stepped) -> None:
    action = robot.robot.actions[OUT]
    assert not action.begin(b"0" * 16, GOAL)
    fill_pallet(robot)
    assert newest(robot, "/cell/pallet_permitted") is True
    assert action.begin(b"1" * 16, GOAL)
    assert not action.begin(b"2" * 16, GOAL)
    robot.run(OUT_S / 2)
    ((goal, feedback),) = action.feedback()
    assert (goal, feedback) == (b"1" * 16, {"sequence": [pytest.approx(50, abs=3)]})
    assert action.result(b"1" * 16) is None
    robot.run(OUT_S)
    assert action.result(b"1" * 16) == (SUCCEEDED, {"sequence": [100]})
    assert newest(robot, "/boxes") <= 2
    assert newest(robot, "/cell/pallet") == 12


def test_a_pallet_out_is_canceled_and_aborted(robot: Stepped) -> None:
    action = robot.robot.actions[OUT]
    assert action.cancel(b"0" * 16) == (CANCEL_UNKNOWN, [])
    fill_pallet(robot)
    action.begin(b"1" * 16, GOAL)
    robot.run(1)
    assert action.cancel(b"1" * 16) == (CANCEL_OK, [b"1" * 16])
    action.begin(b"2" * 16, GOAL)
    robot.run(1)
    assert (b"2" * 16, EXECUTING) in action.states()
    robot.hear("/cell/stop")
    robot.run(0.2)
    assert action.states() == [(b"1" * 16, CANCELED), (b"2" * 16, ABORTED)]
    assert newest(robot, "/boxes") == BOXES


def test_an_entry_of_the_demo_table_takes_its_name_out_of_the_story(
    stepped: Callable[..., Stepped],
) -> None:
    robot = stepped(PANEL + '[demo."/boxes"]\nvalues = [7]\n').run(10)
    assert set(robot.values("/boxes")) == {7}
    assert newest(robot, "/cell/layer") == 4


def test_without_a_story_the_names_are_those_of_any_panel(stepped: Callable[..., Stepped]) -> None:
    robot = stepped(PANEL.replace('demo_story = "palletizing"\n', "")).run(5)
    assert answer(robot, "/cell/start") == (True, "done")
    assert newest(robot, "/cell/state") not in set(State)


def test_the_belt_has_the_speed_of_the_parameter(stepped: Callable[..., Stepped]) -> None:
    keys = 'node = "/system_controller"\nparameter = "speed"\ntype = "double"\n'
    robot = stepped(PANEL + widget(500, "parameter") + keys).run(1)
    value = {"type": 3, "double_value": 200.0}
    robot.call("/system_controller/set_parameters", parameters=[{"name": "speed", "value": value}])
    run_until(robot, "/cell/belt_speed", 200, 2 * CYCLE_S)

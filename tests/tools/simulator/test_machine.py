"""The state of a simulated robot without a story fits its interlocks, conditions and alarms."""

from bisect import bisect_right
from pathlib import Path
from typing import Any, Final

import pytest

from app.cell.permission.conditions import permits
from app.panel import Panel, load_panel
from app.panel.condition import Condition
from tests.support.stepped import STEP_S, Stepped

pytestmark = pytest.mark.promise("demo")

ROUNDS_S: Final = 120
STATES: Final = """
title = "Cell"
mode = "demo"
[state]
topic = "/state"
type = "std_msgs/msg/String"
states = [
  { value = "RUNNING", text = "Runs", shape = "play" },
  { value = "PAUSED", text = "Pause", shape = "pause" },
  { value = "HOT", text = "Hot", shape = "triangle", colour = "yellow" },
  { value = "FAULT", text = "Fault", shape = "cross", colour = "red" },
]
[[page]]
id = "one"
title = "One"
[[page.widget]]
id = "go"
kind = "publish"
label = "Go"
topic = "/go"
type = "std_msgs/msg/Empty"
message = {}
"""
DOOR: Final = '[[interlock]]\nid = "door"\ntopic = "/door"\n'
CONFIRM: Final = 'confirm = { topic = "/state", type = "std_msgs/msg/String", equals = "RUNNING" }\n'
TEMPERATURE: Final = (
    '[[interlock]]\nid = "cool"\ntopic = "/t"\ntype = "std_msgs/msg/Float64"\nmax = 60.0\n'
)
MODES: Final = "".join(
    f'[[interlock]]\nid = "{mode}"\ntopic = "/mode"\ntype = "std_msgs/msg/String"\nequals = "{mode}"\n'
    for mode in ("auto", "hand")
)
RUNS: Final = '[[interlock]]\nid = "{0}"\ntopic = "/state"\ntype = "std_msgs/msg/String"\n{1} = "{2}"\n'
PART: Final = '[[condition]]\nid = "part"\ntopic = "/part"\nequals = false\n'
ALARM: Final = (
    '[[alarm]]\nid = "{0}"\npriority = {1}\ntext = "A"\n{2}when = {{ topic = "/{0}", equals = true }}\n'
)
PANELS: Final = {
    "door": DOOR,
    "press": CONFIRM + DOOR,
    "several": DOOR + TEMPERATURE + PART,
    "modes": DOOR + MODES,
    "state": DOOR
    + RUNS.format("start", "not_equals", "RUNNING")
    + RUNS.format("on", "equals", "RUNNING"),
    "alarm": DOOR + ALARM.format("jam", 1, ""),
    "state of an alarm": DOOR + ALARM.format("hot", 3, 'state = "HOT"\n'),
    "enabled": DOOR.replace("/door", "/operation_enabled"),
    "table": DOOR + '[demo."/door"]\nperiod_s = 9\n',
    "values": DOOR + '[demo."/door"]\nvalues = [true, false]\nperiod_s = 13\n',
}


def loaded(tmp_path: Path, tables: str) -> Panel:
    path = tmp_path / "cell.toml"
    path.write_text(STATES + tables)
    return load_panel(path)


@pytest.mark.parametrize("tables", PANELS.values(), ids=PANELS)
def test_a_machine_never_runs_against_its_interlocks_conditions_and_alarms(
    tmp_path: Path, tables: str
) -> None:
    panel = loaded(tmp_path, tables)
    robot = Stepped(panel)
    for _ in range(ROUNDS_S // 2):
        robot.hear("/go")
        robot.run(2)

    def at(condition: Condition, time: float) -> Any:
        timed = robot.timed(condition.topic, condition.field)
        return timed[bisect_right([at for at, _ in timed], time) - 1][1]

    fields = {c.topic: [o for o in panel.named_conditions if o.topic == c.topic]
              for c in panel.named_conditions if c.topic != "/state"}  # fmt: skip
    seen = set()
    for time, state in robot.timed("/state"):
        failed = any(not any(permits(c, at(c, time)) for c in several) for several in fields.values())
        raised = [
            alarm for alarm in panel.alarms if alarm.when and permits(alarm.when, at(alarm.when, time))
        ]
        named = next((alarm.state for alarm in raised if alarm.state), None)
        if named or failed or raised:
            assert state == (named or "FAULT"), time
        else:
            assert state in {"RUNNING", "PAUSED", "HOT"}, time
        seen.add(state)
    assert {"RUNNING", "FAULT"} <= seen


def test_a_change_of_the_door_is_a_change_of_the_state_at_once(tmp_path: Path) -> None:
    robot = Stepped(loaded(tmp_path, DOOR)).run(60)
    opened = [time for time, value in robot.timed("/door") if not value]
    failed = [time for time, value in robot.timed("/state") if value == "FAULT"]
    assert opened[0] == pytest.approx(failed[0], abs=STEP_S)

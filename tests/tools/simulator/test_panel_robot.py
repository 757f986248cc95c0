"""The robot of any panel, stepped by hand."""

import itertools
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Final, Literal

import pytest

from app.cell.permission.conditions import permits
from app.cell.robot.parameter_state import EMPTY_VALUE
from app.cell.robot.transforms import TF_TYPE
from app.panel import Panel, load_panel
from app.panel.widgets.families import Display
from app.panel.widgets.map_layers import UPDATE_TYPE
from app.panel.widgets.publish import SinglePublish
from app.ros.messages import DISTROS
from app.ros.messages.names import Qos
from app.tools.simulator.in_process import robots_of
from app.tools.simulator.kinds import needs_of
from app.tools.simulator.known_types import Moment
from app.tools.simulator.machine import APART_S
from app.tools.simulator.needs import DisplayedField, Published
from app.tools.simulator.panel_robot import PanelRobot
from app.tools.simulator.parameters import EVENTS
from app.tools.simulator.robot import FORBIDDEN_S, PERMITTED_S
from app.tools.simulator.zenoh import ANY_PORT, Simulator
from tests.support.beside_panel import put_beside
from tests.support.builders import INTERFACES
from tests.support.parts import REFERENCE, TESTS
from tests.support.stepped import STEP_S, Stepped

pytestmark = pytest.mark.promise("demo")

ROUND_S: Final = PERMITTED_S + FORBIDDEN_S
HEAD: Final = 'title = "Cell"\nmode = "demo"\n'
Loaded = Callable[[str], Panel]


@pytest.fixture
def loaded(tmp_path: Path) -> Loaded:
    """A panel with these tables, and a page at their end."""

    def panel(tables: str) -> Panel:
        path = tmp_path / "cell.toml"
        page = "" if "[[page]]" in tables else '[[page]]\nid = "one"\ntitle = "One"\n'
        path.write_text(f"{HEAD}{page}{tables}")
        return load_panel(path)

    return panel


def readout(topic: str, type_name: str, field: str = "data", **more: str) -> str:
    lines = "\n".join(f"{key} = {value}" for key, value in more.items())
    name = f"r{abs(hash((topic, field)))}"
    return (
        f'[[page.widget]]\nid = "{name}"\nkind = "readout"\nlabel = "Shown"\ntopic = "{topic}"\n'
        f'type = "{type_name}"\nfield = "{field}"\n{lines}\n'
    )


def test_number_moves_smoothly_within_its_units_range(loaded: Loaded) -> None:
    robot = Stepped(loaded(readout("/t", "std_msgs/msg/Float32", unit='"°C"'))).run(60)
    values = robot.values("/t")
    assert len(values) == pytest.approx(60 * 5, abs=2)
    assert (min(values) >= 20, max(values) <= 60, max(values) - min(values) > 20) == (True,) * 3
    assert max(abs(a - b) for a, b in itertools.pairwise(values)) < 2


def test_scale_and_offset_lead_to_the_unit(loaded: Loaded) -> None:
    robot = Stepped(loaded(readout("/raw", "std_msgs/msg/Int16", unit='"bar"', scale="0.001"))).run(30)
    values = robot.values("/raw")
    assert 4700 <= min(values) < max(values) <= 6700


@pytest.mark.parametrize(
    ("type_name", "field"),
    [
        ("sensor_msgs/msg/JointState", "position[name=axis_3]"),
        ("diagnostic_msgs/msg/DiagnosticArray", "status[name='drive: motor'].message"),
        ("visualization_msgs/msg/MarkerArray", "markers[id=5].text"),
        ("std_msgs/msg/Float64MultiArray", "data[11]"),
        ("nav_msgs/msg/Odometry", "pose.pose.position.x"),
        ("std_msgs/msg/String", "data"),
        ("sensor_msgs/msg/Image", "height"),
        ("sensor_msgs/msg/NavSatFix", "latitude"),
    ],
)
def test_every_field_that_a_panel_shows_has_a_value(loaded: Loaded, type_name: str, field: str) -> None:
    robot = Stepped(loaded(readout("/x", type_name, field))).run(1)
    assert robot.values("/x", field)[0] is not None


@pytest.mark.parametrize(
    ("type_name", "field", "least", "most"),
    [
        ("sensor_msgs/msg/LaserScan", "min(ranges)", 0.5, 0.9),
        ("sensor_msgs/msg/LaserScan", "max(ranges)", 5.0, 6.0),
        ("nav_msgs/msg/Odometry", "yaw(pose.pose.orientation)", -1.0, 1.0),
        ("nav_msgs/msg/Odometry", "norm(twist.twist.linear)", 0.5, 2.0),
        ("geometry_msgs/msg/PoseArray", "length(poses)", 2, 9),
        ("std_msgs/msg/Float64MultiArray", "diff(data[0], data[3])", 0.0, 0.5),
    ],
)
def test_functions_of_interlocks_permit_and_forbid(
    loaded: Loaded, type_name: str, field: str, least: float, most: float
) -> None:
    table = f'topic = "/x"\ntype = "{type_name}"\nfield = "{field}"\nmin = {least}\nmax = {most}\n'
    panel = loaded(f'[[interlock]]\nid = "near"\n{table}')
    robot = Stepped(panel).run(ROUND_S)
    met = {permits(panel.interlocks[0], value) for value in robot.values("/x", field)}
    assert met == {True, False}


@pytest.mark.parametrize("limits", ["min = 0.2", "scale = 100\nmin = 20", "scale = 100\nmax = 90"])
def test_a_field_of_an_interlock_stays_within_what_it_can_be(loaded: Loaded, limits: str) -> None:
    battery = 'topic = "/battery"\ntype = "sensor_msgs/msg/BatteryState"\nfield = "percentage"\n'
    panel = loaded(f'[[interlock]]\nid = "charge"\n{battery}unit = "%"\n{limits}\n')
    values = Stepped(panel).run(ROUND_S * 2).values("/battery", "percentage")
    assert {permits(panel.interlocks[0], value) for value in values} == {True, False}
    assert 0 <= min(values) < max(values) <= 1


def test_constants_and_lamps_show_all_their_values(loaded: Loaded) -> None:
    lamp = (
        '[[page.widget]]\nid = "lamp"\nkind = "indicator"\nlabel = "Lamp"\ntopic = "/lamp"\n'
        'type = "std_msgs/msg/UInt8"\nstates = ['
        + ", ".join(f'{{ value = {n}, text = "{n}", shape = "circle" }}' for n in (3, 7, 9))
        + "]\n"
    )
    health = readout(
        "/b",
        "sensor_msgs/msg/BatteryState",
        "power_supply_health",
        constants='"POWER_SUPPLY_HEALTH_"',
    )
    robot = Stepped(loaded(lamp + health)).run(150)
    assert set(robot.values("/lamp")) == {3, 7, 9}
    shown = robot.values("/b", "power_supply_health")
    assert set(shown) == set(range(9))
    assert shown.count(1) > len(shown) / 2  # GOOD


BOOL_LOCK: Final = '[[interlock]]\nid = "{0}"\ntopic = "/{0}"\n'


def runs(timed: Iterable[tuple[float, Any]]) -> list[tuple[float, Any]]:
    """When a value begins, and which."""
    changes: list[tuple[float, Any]] = []
    for at, value in timed:
        if not changes or changes[-1][1] != value:
            changes.append((at, value))
    return changes


def test_an_interlock_permits_20_s_and_forbids_8_s(loaded: Loaded) -> None:
    robot = Stepped(loaded(BOOL_LOCK.format("door"))).run(2 * ROUND_S + 1)
    assert runs(robot.timed("/door")) == [
        (0.0, True),
        (PERMITTED_S, False),
        (ROUND_S, True),
        (ROUND_S + PERMITTED_S, False),
        (2 * ROUND_S, True),
    ]


def test_several_interlocks_drop_one_after_the_other_and_all_permit_at_times(loaded: Loaded) -> None:
    names = [f"door_{number}" for number in range(9)]
    robot = Stepped(loaded("".join(BOOL_LOCK.format(name) for name in names))).run(2 * ROUND_S)
    drops = []
    for name in names:
        drop = next(at for at, value in runs(robot.timed(f"/{name}")) if value is False)
        drops.append(drop)
    assert drops == sorted(drops)
    assert len(set(drops)) == len(drops)
    assert drops[-1] - drops[0] <= 8.1
    last_back = drops[-1] + FORBIDDEN_S
    assert drops[0] + ROUND_S - last_back > 10


CONDITIONS: Final = [
    ("std_msgs/msg/UInt8", "equals = 4"),
    ("std_msgs/msg/UInt8", "equals = 255"),
    ("std_msgs/msg/UInt8", "not_equals = 0"),
    ("std_msgs/msg/Int8", "one_of = [1, 4]"),
    ("std_msgs/msg/Float32", "min = 5.5"),
    ("std_msgs/msg/Float64", "min = 500000.0\nmax = 800000.0"),
    ("std_msgs/msg/Int32", "min = 3\nmax = 4"),
    ("std_msgs/msg/Float64", "min = -1.0\nnot_equals = 0.0"),
    ("std_msgs/msg/Bool", "equals = false"),
    ("std_msgs/msg/String", 'equals = "auto"'),
    ("std_msgs/msg/String", 'not_equals = ""'),
    ("std_msgs/msg/String", 'one_of = ["auto", "manual"]'),
]


@pytest.mark.parametrize(("type_name", "conditions"), CONDITIONS)
def test_an_interlock_follows_its_own_conditions(
    loaded: Loaded, type_name: str, conditions: str
) -> None:
    lock = f'[[interlock]]\nid = "one"\ntopic = "/one"\ntype = "{type_name}"\n{conditions}\n'
    panel = loaded(lock)
    robot = Stepped(panel).run(ROUND_S)
    by_time = [(at, permits(panel.interlocks[0], value)) for at, value in robot.timed("/one")]
    assert runs(by_time) == [(0.0, True), (PERMITTED_S, False)]


def test_a_constant_in_another_message_permits_and_forbids(loaded: Loaded) -> None:
    lock = (
        '[[interlock]]\nid = "one"\ntopic = "/b"\ntype = "sensor_msgs/msg/BatteryState"\n'
        'field = "power_supply_health"\nequals = "POWER_SUPPLY_HEALTH_GOOD"\n'
    )
    shown = readout("/b", "sensor_msgs/msg/BatteryState", "percentage")
    robot = Stepped(loaded(lock + shown)).run(ROUND_S)
    assert runs(robot.timed("/b", "power_supply_health"))[0] == (0.0, 1)
    assert runs(robot.timed("/b", "power_supply_health"))[1][0] == PERMITTED_S
    assert robot.values("/b", "percentage")[0] == 1.0


def test_interlocks_that_exclude_each_other_have_their_turns(loaded: Loaded) -> None:
    locks = "".join(
        f'[[interlock]]\nid = "{name}"\ntopic = "/mode"\ntype = "std_msgs/msg/String"\n'
        f'equals = "{name}"\n'
        for name in ("auto", "manual")
    )
    robot = Stepped(loaded(locks)).run(4 * ROUND_S)
    assert {"auto", "manual"} < set(robot.values("/mode"))


PRESSES: Final = """
[[page]]
id = "one"
title = "One"
[[page.widget]]
id = "speed"
kind = "number"
label = "Speed"
min = 0.0
max = 10.0
[[page.widget]]
id = "set"
kind = "publish"
label = "Set"
topic = "/set"
type = "geometry_msgs/msg/Twist"
message = { linear = { x = "{speed}" } }
confirm = { topic = "/is", type = "std_msgs/msg/Float32", equals = "{speed}" }
[[page.widget]]
id = "on"
kind = "publish"
label = "On"
topic = "/fan"
type = "std_msgs/msg/Bool"
message = { data = true }
confirm = { topic = "/fan_state", type = "std_msgs/msg/String", equals = "on" }
[[page.widget]]
id = "off"
kind = "publish"
label = "Off"
topic = "/fan"
type = "std_msgs/msg/Bool"
message = { data = false }
confirm = { topic = "/fan_state", type = "std_msgs/msg/String", equals = "off" }
[[page.widget]]
id = "note"
kind = "text"
label = "Note"
[[page.widget]]
id = "tell"
kind = "publish"
label = "Tell"
topic = "/note"
type = "std_msgs/msg/String"
message = { data = "note: {note}!" }
confirm = { topic = "/heard", type = "std_msgs/msg/String", equals = "{note}" }
[[page.widget]]
id = "shown"
kind = "readout"
label = "Note"
topic = "/note"
type = "std_msgs/msg/String"
"""


def test_a_press_has_the_effect_that_confirms_it(loaded: Loaded) -> None:
    robot = Stepped(loaded(PRESSES)).run(1)
    robot.hear("/set", linear={"x": 7.25})
    robot.hear("/fan", data=True)
    robot.hear("/note", data="note: a {b}!")
    robot.run(0.1)
    assert robot.values("/is")[-1] == 7.25
    assert robot.values("/fan_state")[-1] == "on"
    assert robot.values("/heard")[-1] == "a {b}"
    robot.hear("/fan", data=False)
    robot.run(40)
    assert robot.values("/fan_state")[-1] == "off"
    assert robot.values("/is")[-1] == 7.25


NAMED: Final = """
[[page]]
id = "one"
title = "One"
[[page.widget]]
id = "warn"
kind = "publish"
label = "Warn"
topic = "/warn"
type = "diagnostic_msgs/msg/DiagnosticStatus"
message = { level = "WARN" }
[page.widget.confirm]
topic = "/is"
type = "diagnostic_msgs/msg/DiagnosticStatus"
field = "level"
equals = "WARN"
[demo."/is"]
values = ["STALE", "ERROR"]
"""


SHARED: Final = """
robot = [{ id = "a", name = "A", namespace = "/a" }, { id = "b", name = "B", namespace = "/b" }]
[[page]]
id = "one"
title = "One"
[[page.widget]]
id = "door"
kind = "readout"
label = "Door"
topic = "//cell/door"
type = "std_msgs/msg/Bool"
[[page.widget]]
id = "speed"
kind = "readout"
label = "Speed"
topic = "/speed"
type = "std_msgs/msg/Float64"
[[page.widget]]
id = "open"
kind = "call"
label = "Open"
service = "//cell/open"
type = "std_srvs/srv/Trigger"
"""


def test_shared_topics_of_several_robots_are_simulated_once(loaded: Loaded) -> None:
    with Simulator(ANY_PORT, robots_of(loaded(SHARED)), INTERFACES) as played:
        tokens = [token for robot in played.robots for token in robot.tokens()]
    names = [token.split("/")[4] for token in tokens if "/MP/" in token or "/SS/" in token]
    assert [names.count(name) for name in ("a§speed", "b§speed", "cell§door", "cell§open")] == [1] * 4


def test_names_of_constants_confirm_and_are_simulated(loaded: Loaded) -> None:
    robot = Stepped(loaded(NAMED)).run(40)
    assert set(robot.values("/is", "level")) <= {3, 2}
    robot.hear("/warn", level=1)
    robot.run(1)
    assert robot.values("/is", "level")[-1] == 1


def test_confirming_topic_changes_only_with_presses(loaded: Loaded) -> None:
    robot = Stepped(loaded(PRESSES)).run(60)
    assert len(set(robot.values("/is"))) == len(set(robot.values("/fan_state"))) == 1


def test_a_press_is_seen_where_the_panel_shows_the_topic(loaded: Loaded) -> None:
    robot = Stepped(loaded(PRESSES)).run(1)
    robot.hear("/note", data="note: hello!")
    robot.run(5)
    assert robot.values("/note")[-1] == "note: hello!"


def test_a_message_of_no_press_has_no_effect(loaded: Loaded) -> None:
    robot = Stepped(loaded(PRESSES)).run(1)
    before = robot.values("/heard")[-1]
    robot.hear("/note", data="something else")
    robot.robot.receive("/fan", b"\0")
    robot.run(2)
    assert robot.values("/heard")[-1] == before


CALLS: Final = "[[page]]\nid = 'one'\ntitle = 'One'\n" + "".join(
    f"[[page.widget]]\nid = '{name}'\nkind = 'call'\nlabel = '{name}'\nservice = '/{name}'\n"
    f"type = '{kind}'\n{more}\n"
    for name, kind, more in (
        ("home", "std_srvs/srv/Trigger", ""),
        ("reset", "std_srvs/srv/Trigger", ""),
        ("state", "lifecycle_msgs/srv/GetState", ""),
        ("load", "nav_msgs/srv/LoadMap", ""),
        (
            "add",
            "rcl_interfaces/srv/SetParametersAtomically",
            "success = 'result.successful'\nmessage = 'result.reason'",
        ),
    )
)


def test_services_of_any_type_succeed(loaded: Loaded) -> None:
    robot = Stepped(loaded(CALLS)).run(PERMITTED_S + 1)
    for service in ("/home", "/reset"):  # /reset too: this panel does not show /operation_enabled
        answer = robot.call(service)
        assert (answer.success, answer.message) == (True, "done")
    assert robot.call("/state").current_state.label == "active"
    assert robot.call("/load").result == 0
    assert robot.call("/add").result.successful is True
    assert robot.robot.serve("/home", b"") is None


def test_demo_table_sets_the_response_of_a_service(loaded: Loaded) -> None:
    table = '[demo."/home"]\nresponse = { success = false, message = "the door is open" }\n'
    answer = Stepped(loaded(CALLS + table)).run(1).call("/home")
    assert (answer.success, answer.message) == (False, "the door is open")


ACTION: Final = """
[[page]]
id = "one"
title = "One"
[[page.widget]]
id = "go"
kind = "action"
label = "Go"
action = "/go"
type = "example_interfaces/action/Fibonacci"
progress = "sequence[0]"
progress_max = 50
"""


def test_an_action_says_its_progress_and_ends_with_a_result(loaded: Loaded) -> None:
    robot = Stepped(loaded(f'{ACTION}[demo."/go"]\nduration_s = 4\nresult = {{ sequence = [5] }}\n'))
    action = robot.run(1).robot.actions["/go"]
    assert action.begin(b"a" * 16, SimpleNamespace())
    assert not action.begin(b"a" * 16, SimpleNamespace())
    numbers = []
    while action.result(b"a" * 16) is None:
        robot.run(STEP_S)
        numbers += [fields["sequence"][0] for _, fields in action.feedback()]
    assert numbers == sorted(numbers)
    assert (numbers[0] < 10, numbers[-1] > 40, len(numbers) > 5) == (True, True, True)
    assert robot.now == pytest.approx(5.0, abs=0.2)
    assert action.result(b"a" * 16) == (4, {"sequence": [5]})
    assert action.states() == [(b"a" * 16, 4)]


def test_goals_are_canceled_one_or_all(loaded: Loaded) -> None:
    robot = Stepped(loaded(ACTION)).run(1)
    action = robot.robot.actions["/go"]
    for goal in (b"a" * 16, b"b" * 16, b"c" * 16):
        assert action.begin(goal, SimpleNamespace())
    assert action.cancel(b"a" * 16) == (0, [b"a" * 16])
    assert action.cancel(b"a" * 16) == (3, [])
    assert action.cancel(b"x" * 16) == (2, [])
    assert action.cancel(bytes(16)) == (0, [b"b" * 16, b"c" * 16])
    ended = action.result(b"a" * 16)
    assert ended is not None
    assert ended[0] == 5
    assert action.result(b"x" * 16) == (0, {})


PARAMETERS: Final = "[[page]]\nid = 'one'\ntitle = 'One'\n" + "".join(
    f"[[page.widget]]\nid = '{name}'\nkind = 'parameter'\nlabel = '{name}'\nnode = '/arm'\n"
    f"parameter = '{name}'\ntype = '{kind}'\n{more}\n"
    for name, kind, more in (
        ("gain", "double", "min = 0.0\nmax = 2.0\nstep = 0.5"),
        ("tries", "integer", "max = 5"),
        ("slow", "bool", ""),
        ("tool", "string", ""),
        ("preset", "integer", "options = [{ value = 3, label = 'A' }, { value = 5, label = 'B' }]"),
        ("speeds", "double[]", "min = 0\nmax = 1"),
        ("names", "string[]", ""),
    )
)


def set_to(robot: Stepped, name: str, kind: int, field: str, value: Any) -> str:
    """The reason why a parameter is not set, or ""."""
    parameter = {"name": name, "value": {**EMPTY_VALUE, "type": kind, field: value}}
    (result,) = robot.call("/arm/set_parameters", parameters=[parameter]).results
    assert result.successful is (result.reason == "")
    return str(result.reason)


@pytest.mark.parametrize(
    ("name", "kind", "field", "value", "reason"),
    [
        ("gain", 3, "double_value", 1.5, ""),
        ("gain", 3, "double_value", 1.4, "out of its range"),
        ("gain", 2, "integer_value", 1, "has another type"),
        ("tries", 2, "integer_value", -7, ""),
        ("tries", 2, "integer_value", 6, "out of its range"),
        ("slow", 1, "bool_value", True, ""),
        ("tool", 4, "string_value", "", ""),
        ("preset", 2, "integer_value", 5, ""),
        ("preset", 2, "integer_value", 4, "no such option"),
        ("speeds", 8, "double_array_value", [0.25, 1.0], ""),
        ("speeds", 8, "double_array_value", [0.25, 1.5], "out of its range"),
        ("names", 9, "string_array_value", ["a", "b"], ""),
        ("other", 1, "bool_value", True, "not declared"),
    ],
)
def test_simulated_parameters_have_the_panels_limits_and_options(
    loaded: Loaded, name: str, kind: int, field: str, value: Any, reason: str
) -> None:
    robot = Stepped(loaded(PARAMETERS)).run(1)
    assert reason in set_to(robot, name, kind, field, value)
    assert (reason == "") is (EVENTS in robot.run(STEP_S).said)
    if not reason:
        (held,) = robot.call("/arm/get_parameters", names=[name]).values
        sent = getattr(held, field)
        assert (list(sent) if isinstance(value, list) else sent) == value


def test_the_first_values_of_parameters_fit_and_can_be_given(loaded: Loaded) -> None:
    table = '[demo."/arm"]\nparameters = { gain = 2.0, tool = "gripper", speeds = [1] }\n'
    robot = Stepped(loaded(PARAMETERS + table)).run(1)
    names = ["gain", "tool", "speeds", "preset"]
    gain, tool, speeds, preset = robot.call("/arm/get_parameters", names=names).values
    assert (gain.double_value, tool.string_value, list(speeds.double_array_value)) == (
        2.0,
        "gripper",
        [1.0],
    )
    assert preset.integer_value == 3
    plain = Stepped(loaded(PARAMETERS)).run(1)
    first = plain.call("/arm/get_parameters", names=["gain"]).values[0].double_value
    assert (set_to(plain, "gain", 3, "double_value", first), 0 <= first <= 2) == ("", True)


def test_the_demo_table_sets_range_period_values_rate_and_silence(loaded: Loaded) -> None:
    tables = (
        readout("/a", "std_msgs/msg/Float64")
        + readout("/b", "std_msgs/msg/String")
        + readout("/c", "std_msgs/msg/Bool")
        + readout("/d", "sensor_msgs/msg/BatteryState", "voltage")
        + BOOL_LOCK.format("door")
        + '[demo."/a"]\nrange = [11.0, 12.5]\nperiod_s = 10\nhz = 10\n'
        + '[demo."/b"]\nvalues = ["P12", "P14"]\nperiod_s = 4\n'
        + '[demo."/c"]\nsilent = true\n'
        + '[demo."/d"]\nmessage = { voltage = 24.0, header = { frame_id = "pack" } }\n'
        + '[demo."/door"]\nperiod_s = 14\n'
    )
    robot = Stepped(loaded(tables)).run(28)
    values = robot.values("/a")
    assert len(values) == 280
    assert (min(values), max(values)) == (pytest.approx(11, abs=0.01), pytest.approx(12.5, abs=0.01))
    assert [at for at, value in runs(robot.timed("/b")) if value == "P12"][:3] == [0, 4, 8]
    assert "/c" not in robot.robot.publishes
    assert set(robot.values("/d", "voltage")) == {24.0}
    assert set(robot.values("/d", "header.frame_id")) == {"pack"}
    assert robot.values("/d", "header.stamp.sec")[0] == 10**9
    assert runs(robot.timed("/door"))[:3] == [(0.0, True), (10.0, False), (14.0, True)]


def test_a_silent_server_or_subscriber_is_not_there(loaded: Loaded) -> None:
    silent = "".join(f'[demo."{name}"]\nsilent = true\n' for name in ("/set", "/is"))
    robot = PanelRobot(loaded(PRESSES + silent))
    assert "/set" not in robot.subscribes
    assert "/is" not in robot.publishes
    assert "/home" not in PanelRobot(loaded(CALLS + '[demo."/home"]\nsilent = true\n')).services
    assert "/go" not in PanelRobot(loaded(ACTION + '[demo."/go"]\nsilent = true\n')).actions
    nodes = PanelRobot(loaded(PARAMETERS + '[demo."/arm"]\nsilent = true\n')).services
    assert "/arm/get_parameters" not in nodes


def test_simulated_qos_is_the_panels_qos(loaded: Loaded) -> None:
    qos = '{ reliability = "best_effort", durability = "transient_local", depth = 3 }'
    robot = PanelRobot(loaded(readout("/x", "std_msgs/msg/Bool", qos=qos, max_age_s="0.3")))
    assert robot.publishes["/x"].qos == Qos(False, True, 3)


def test_topic_with_max_age_is_published_often_enough(loaded: Loaded) -> None:
    robot = Stepped(loaded(readout("/x", "std_msgs/msg/Bool", max_age_s="0.5"))).run(10)
    times = [at for at, _ in robot.timed("/x")]
    assert max(b - a for a, b in itertools.pairwise(times)) < 0.5


def test_names_of_the_reference_system_with_other_types_are_the_panels(loaded: Loaded) -> None:
    tables = readout("/last_heard", "std_msgs/msg/Int32") + CALLS.replace("/home", "/light").replace(
        "[[page]]\nid = 'one'\ntitle = 'One'\n", ""
    )
    robot = Stepped(loaded(tables)).run(2)
    assert len(robot.values("/last_heard")) > 1
    assert robot.call("/light").message == "done"


def test_reference_system_behaves_as_described() -> None:
    robot = Stepped(load_panel(REFERENCE)).run(1)
    assert "/last_heard" not in robot.said
    robot.hear("/operation1", data="hello")
    robot.run(PERMITTED_S)
    assert robot.values("/last_heard") == ["hello (/operation1)"]
    assert runs(robot.timed("/operation_enabled")) == [(0.0, True), (PERMITTED_S, False)]
    latched: Mapping[str, Qos] = {name: topic.qos for name, topic in robot.robot.publishes.items()}
    assert latched["/operation_enabled"].transient_local
    assert robot.call("/reset").message == "not while operation is forbidden"
    assert robot.call("/light", data=True).message == "the light is on"


def test_interlocks_are_apart_by_no_more_than_they_forbid() -> None:
    assert APART_S < FORBIDDEN_S


class Gauge(Display):
    """A kind that no table knows, with limits of what it shows."""

    kind: Literal["gauge"]
    min: float
    max: float
    scale: float = 1.0
    offset: float = 0.0


class Big(SinglePublish):
    """A command that no table knows."""

    kind: Literal["big"]


GAUGE: Final = {"id": "g", "kind": "gauge", "label": "G", "topic": "/g", "type": "std_msgs/msg/Float32"}
BIG: Final = {"id": "b", "kind": "big", "label": "B", "topic": "/b", "type": "std_msgs/msg/Bool"}


@pytest.mark.parametrize(
    ("more", "low", "high"),
    [
        ({"min": -3.0, "max": 9.0}, -3.0, 9.0),
        ({"min": 0.0, "max": 100.0, "scale": 100.0}, 0.0, 1.0),
        ({"min": 0.0, "max": 10.0, "scale": -1.0, "offset": 5.0}, -5.0, 5.0),
    ],
)
def test_a_new_kind_needs_no_row_where_its_family_says_all(
    more: dict[str, float], low: float, high: float
) -> None:
    (need,) = needs_of(Gauge.model_validate(GAUGE | more), INTERFACES)
    assert isinstance(need, DisplayedField)
    assert (need.topic, need.field, need.low, need.high) == ("/g", "data", low, high)
    (press,) = needs_of(Big.model_validate(BIG | {"message": {"data": True}}), INTERFACES)
    assert isinstance(press, Published)
    assert (press.topic, press.template) == ("/b", {"data": True})


def test_a_topic_without_a_row_has_values_all_the_same(
    loaded: Loaded, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As of a kind with several topics, which the panel subscribes to."""
    panel = loaded("")
    subscribed = {"/pose": "geometry_msgs/msg/PoseStamped", "/x": "std_msgs/msg/Float32"}
    monkeypatch.setattr(type(panel), "subscriptions", lambda _: subscribed)
    monkeypatch.setattr(type(panel), "subscribed_fields", lambda _: {"/x": ["data"]})
    robot = Stepped(panel).run(5)
    assert len(set(robot.values("/pose", "pose.position.x"))) > 10
    assert len(set(robot.values("/x"))) > 10


def test_a_press_is_confirmed_on_a_topic_of_the_reference_system_too(loaded: Loaded) -> None:
    confirm = 'confirm = { topic = "/last_heard", type = "std_msgs/msg/String", equals = "{note}" }'
    plain = PRESSES.replace('topic = "/heard", type = "std_msgs/msg/String", equals = "{note}"', "")
    robot = Stepped(loaded(plain.replace("confirm = {  }", confirm))).run(1)
    robot.hear("/note", data="note: hello!")
    assert robot.run(STEP_S).values("/last_heard") == ["hello"]


def test_a_fast_topic_comes_as_often_as_the_table_says(loaded: Loaded) -> None:
    panel = loaded(readout("/fast", "std_msgs/msg/Float32") + '[demo."/fast"]\nhz = 100\n')
    robot = PanelRobot(panel)
    assert robot.step_s == 0.01
    times = range(200)
    count = sum(t == "/fast" for at in times for t, _ in robot.step(Moment(at / 100, 10**18)))
    assert count == 200


def test_a_topic_that_can_not_be_made_is_silent_and_the_others_go_on(
    loaded: Loaded, caplog: pytest.LogCaptureFixture
) -> None:
    panel = loaded(readout("/a", "std_msgs/msg/Float32") + readout("/b", "std_msgs/msg/Float32"))
    stepped = Stepped(panel).run(1)
    assert {"/a", "/b"} <= set(stepped.robot.publishes)
    stepped.robot._topics["/a"].show("data", "no number", 1.0)
    stepped.run(2)
    assert stepped.timed("/a")[-1][0] < 1.1
    assert stepped.timed("/b")[-1][0] > 2.5
    assert caplog.text.count("/a is not simulated any more: data: must be a number") == 1


@pytest.mark.parametrize("distro", DISTROS)
def test_everything_is_simulated_in_each_distribution(tmp_path: Path, distro: str) -> None:
    messages = tmp_path / "msgs/cell_msgs/msg"
    messages.mkdir(parents=True)
    (messages / "Jog.msg").write_text("float64 speed\nuint32 valid_ms\nuint16 number\n")
    put_beside(tmp_path)
    path = tmp_path / "cell.toml"
    text = (TESTS / "everything.toml").read_text()
    path.write_text(text.replace('distro = "jazzy"', f'distro = "{distro}"'))
    robot = Stepped(load_panel(path)).run(2)
    listened = robot.panel.subscriptions().items()
    wanted = {topic for topic, kind in listened if kind != UPDATE_TYPE} - {EVENTS}
    assert wanted <= set(robot.said)
    assert all(publish.type_hash for publish in robot.robot.publishes.values())


def test_what_moves_is_not_on_tf_static(loaded: Loaded) -> None:
    widget = (
        '[[page]]\nid = "map"\ntitle = "Map"\n[[page.widget]]\nid = "map"\nkind = "map"\nlabel = "M"\n'
    )
    robot = Stepped(loaded(widget)).run(5)

    def transforms(topic: str) -> set[tuple[str, float]]:
        messages = (robot.interfaces.decode(TF_TYPE, payload) for _, payload in robot.said[topic])
        return {
            (transform.child_frame_id, round(transform.transform.translation.x, 6))
            for message in messages
            for transform in message.transforms
        }

    moving, still = transforms("/tf"), transforms("/tf_static")
    assert len(moving) > 10
    assert len(still) == 1
    assert not {child for child, _ in moving} & {child for child, _ in still}

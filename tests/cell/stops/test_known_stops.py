"""Scripted stops with a known first cause, on running servers: on simulated robots, behind a bridge
with a wrong clock, and on real nodes. The story names the cause, or says that it can't be told; never
another one."""

import re
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any, Final, NamedTuple

import pytest

from app.cell.stops.story import AFTER_S, GAP_S
from tests.support.parts import ROOT, SHIPPED, Bridge, RosNode, Server, until
from tests.support.servers import demo_server, live_server
from tests.support.stamped_bridge import stamped_bridge

pytestmark = [pytest.mark.promise("stops"), pytest.mark.long("table")]

BOOL, TEXT, REAL = "std_msgs/msg/Bool", "std_msgs/msg/String", "std_msgs/msg/Float64"
TOLD_WITHIN_S: Final = 1.0  # after the last change that a story has

CELL: Final = f"""
title = "Cell"
[state]
topic = "/state"
type = "{TEXT}"
stops = ["FAULT", "STOPPED"]
effects = ["no_fault"]
states = [
  {{ value = "RUNNING", text = "Running", shape = "play" }},
  {{ value = "STOPPED", text = "Stopped", shape = "square" }},
  {{ value = "FAULT", text = "Fault", shape = "cross", colour = "red" }},
]
[[interlock]]
id = "guard"
label = "Guard door"
topic = "/guard"
require_publisher = true
[[interlock]]
id = "air"
topic = "/air"
[[interlock]]
id = "no_fault"
topic = "/no_fault"
[[condition]]
id = "box"
label = "Box at the gripper"
topic = "/box"
[[page]]
id = "main"
title = "Main"
[[page.widget]]
id = "start"
kind = "publish"
label = "Start"
topic = "/start"
type = "std_msgs/msg/Empty"
message = {{}}
interlock = ["guard", "air", "no_fault"]
[[page.widget]]
id = "boxes"
kind = "conditions"
label = "Cycle"
conditions = ["box"]
[[frame.widget]]
id = "stop"
kind = "publish"
role = "stop"
label = "Stop"
topic = "/stop"
type = "std_msgs/msg/Empty"
message = {{}}
[[alarm]]
id = "belt"
group = "Drives"
topic = "/belt"
type = "{REAL}"
text = "Belt is slow"
low = 5.0
priority = 3
[[alarm]]
id = "arm"
group = "Drives"
topic = "/arm"
type = "{REAL}"
text = "Arm is slow"
low = 5.0
priority = 3
[[alarm]]
id = "hot"
topic = "/heat"
type = "{REAL}"
text = "Motor is hot"
high = 80.0
on_delay_s = 2.0
priority = 3
"""
TYPES: Final[Mapping[str, str]] = {
    "/state": TEXT, "/guard": BOOL, "/air": BOOL, "/no_fault": BOOL, "/box": BOOL, "/belt": REAL,
    "/arm": REAL, "/heat": REAL,
}  # fmt: skip
WELL: Final[Mapping[str, Any]] = {
    "/state": "RUNNING", "/guard": True, "/air": True, "/no_fault": True, "/box": True, "/belt": 8.0,
    "/arm": 8.0, "/heat": 40.0,
}  # fmt: skip


# A robot that does what a list of times says.

WHOLE_S: Final = 60.0
STEP_S: Final = 0.5
STOP_AT_S: Final = 40.0  # of the stop


Changes = Mapping[str, Sequence[tuple[float, Any]]]


def timeline(changes: Changes) -> str:
    """A panel with a simulated robot whose topics change at these seconds after the stop, which is
    `STOP_AT_S` after its start."""
    rows = []
    steps = [n * STEP_S - STOP_AT_S for n in range(round(WHOLE_S / STEP_S))]
    for topic, first in WELL.items():
        told = changes.get(topic, [])
        values = [next((v for t, v in reversed(told) if t <= at), first) for at in steps]
        written = str(values).replace("True", "true").replace("False", "false").replace("'", '"')
        rows.append(f'"{topic}" = {{ period_s = {WHOLE_S:.0f}, values = {written} }}')
    return CELL + "[demo]\n" + "\n".join(rows) + "\n"


FAULT: Final = [(0.0, "FAULT"), (12.0, "RUNNING")]
FAULT_AND_EFFECT: Final[Changes] = {"/state": FAULT, "/no_fault": [(0.0, False), (12.0, True)]}
CYCLE: Final = [
    change for at in (-36.0, -28.0, -20.0, -12.0, -4.0) for change in ((at, False), (at + 3.0, True))
]


# What an operator does at a simulated robot.


def shipped(*, stops: str = '"FAULT", "STOPPED"') -> str:
    text = SHIPPED.read_text()
    return text.replace("effects = [", f"stops = [{stops}]\neffects = [", 1)


def two_robots() -> str:
    robots = "".join(
        f'[[robot]]\nid = "{name}"\nname = "{name}"\nnamespace = "/{name}"\n' for name in ("a", "b")
    )
    text = shipped().replace('namespace = ""\n', "")
    return text.replace("[[interlock]]", f"{robots}[[interlock]]", 1)


def mobile() -> str:
    folder = ROOT / "docs/examples/mobile-robot"
    text = (folder / "panel.toml").read_text()
    text = text.replace('interfaces = ["', f'interfaces = ["{folder}/')
    return text.replace("[state]\n", '[state]\nstops = ["BLOCKED", "WAITING"]\n', 1)


def passed(seconds: float) -> None:
    """The rule for the first cause looks at times: so much of it has passed."""
    since = time.monotonic()
    until(lambda: time.monotonic() - since > seconds, "some time has passed")


def settled() -> None:
    """What happens right after the start of a server has no first cause."""
    passed(GAP_S + 1.0)


def press(kiosk: Server, widget: str, **inputs: Any) -> None:
    until(lambda: kiosk.widget(widget)["enabled"], f"{widget} is not locked")
    done = kiosk.press(widget, inputs=inputs).json()
    assert done["outcome"] != "refused", done


def door(kiosk: Server, *, is_shut: bool) -> None:
    press(kiosk, "door", door=is_shut)


def opens(kiosk: Server) -> None:
    settled()
    door(kiosk, is_shut=False)


def opens_and_shuts(kiosk: Server) -> None:
    opens(kiosk)
    door(kiosk, is_shut=True)


def opens_then_stop(kiosk: Server) -> None:
    opens(kiosk)
    press(kiosk, "stop")


def press_stop(kiosk: Server) -> None:
    settled()
    press(kiosk, "stop")


def starts_again_then_opens(kiosk: Server) -> None:
    press_stop(kiosk)
    until(lambda: kiosk.widget("start")["enabled"], "it may start")
    press(kiosk, "start")
    until(lambda: not kiosk.widget("start")["enabled"], "it runs")
    at = stopped_at(kiosk, newest(kiosk))
    until(lambda: time.time() > at + AFTER_S + 1.0, "the next stop is another one")
    door(kiosk, is_shut=False)


def opens_right_after_the_start(kiosk: Server) -> None:
    door(kiosk, is_shut=False)


def waits(kiosk: Server) -> None:
    """For what the robot does by itself."""


def drives_into_a_box(kiosk: Server) -> None:
    settled()
    press(kiosk, "obstacle", obstacle=True)
    press(kiosk, "dock")


def drives_and_stops(kiosk: Server) -> None:
    settled()
    press(kiosk, "dock")
    until(lambda: kiosk.widget("dock")["stoppable"], "it drives")
    press(kiosk, "stop")


def stops_while_another_opens(kiosk: Server) -> None:
    opens(kiosk.robot("a"))
    press(kiosk.robot("b"), "stop")


class OnDemo(NamedTuple):
    """`causes` are the ids of what was the first cause; none: it is on no topic, or can't be known."""

    panel: Callable[[], str]
    play: Callable[[Server], None]
    causes: Collection[str]


ON_DEMO: Final[Mapping[str, OnDemo]] = {
    "the guard door is opened": OnDemo(shipped, opens, ["guard_door", "guard"]),
    "the guard door is opened and shut": OnDemo(shipped, opens_and_shuts, ["guard_door", "guard"]),
    "the guard door is opened, then Stop is pressed": OnDemo(
        shipped, opens_then_stop, ["guard_door", "guard"]
    ),
    "Stop, Start, then the guard door": OnDemo(
        shipped, starts_again_then_opens, ["guard_door", "guard"]
    ),
    "air is low": OnDemo(
        lambda: shipped(stops='"WAITING"'), waits, ["air_low", "air", "air_enough", "parts:Gripper"]
    ),
    "the server was started right before": OnDemo(shipped, opens_right_after_the_start, []),
    "a mobile robot meets a box": OnDemo(mobile, drives_into_a_box, ["way_blocked"]),
    "a mobile robot is stopped": OnDemo(mobile, drives_and_stops, ["stop"]),
    "the door of one robot, then Stop of another": OnDemo(
        two_robots, stops_while_another_opens, ["stop"]
    ),
    "a cause on no topic": OnDemo(lambda: timeline(FAULT_AND_EFFECT), waits, []),
    "the first of a group of alarms": OnDemo(
        lambda: timeline(
            {**FAULT_AND_EFFECT, "/belt": [(-3.0, 3.0)], "/arm": [(-2.0, 3.0)], "/air": [(-1.0, False)]}
        ),
        waits,
        ["belt"],
    ),
    "an alarm with a delay began first": OnDemo(
        lambda: timeline({**FAULT_AND_EFFECT, "/heat": [(-4.0, 90.0)], "/air": [(-3.0, False)]}),
        waits,
        ["hot"],
    ),
    "a box is missing in each cycle, then the guard door": OnDemo(
        lambda: timeline({**FAULT_AND_EFFECT, "/box": CYCLE, "/guard": [(-2.0, False)]}),
        waits,
        ["guard"],
    ),
    "a box is missing for longer than in each cycle": OnDemo(
        lambda: timeline({**FAULT_AND_EFFECT, "/box": [*CYCLE[:8], (-6.0, False)]}), waits, ["box"]
    ),
    "Stop is pressed": OnDemo(shipped, press_stop, ["stop"]),
}


@pytest.mark.parametrize("name", ON_DEMO)
def test_first_cause_on_a_simulated_robot(name: str, tmp_path: Path) -> None:
    script = ON_DEMO[name]
    with demo_server(tmp_path, script.panel()) as kiosk:
        script.play(kiosk)
        judge(kiosk, name, script.causes)


# A bridge whose clock is wrong, or whose messages are late.


class Sent(NamedTuple):
    """A message on a topic, sent `at` seconds after the stop."""

    at: float
    topic: str
    data: Any


class OnBridge(NamedTuple):
    """The messages, in the order of their arrival."""

    ahead_s: float
    sent: Sequence[Sent]
    causes: Collection[str]


GUARD_THEN_FAULT: Final = [Sent(-0.012, "/guard", False), Sent(0.0, "/state", "FAULT")]
ON_BRIDGE: Final[Mapping[str, OnBridge]] = {
    "the clock of the bridge is behind": OnBridge(-41.0, GUARD_THEN_FAULT, ["guard"]),
    "the clock of the bridge is ahead": OnBridge(41.0, GUARD_THEN_FAULT, ["guard"]),
    "the effect arrives before its cause": OnBridge(
        0.0,
        [Sent(0.0, "/state", "FAULT"), Sent(-0.01, "/air", False), Sent(-0.03, "/guard", False)],
        ["guard"],
    ),
    "two changes within a millisecond": OnBridge(
        0.0,
        [Sent(-0.0104, "/air", False), Sent(-0.01, "/guard", False), Sent(0.0, "/state", "FAULT")],
        [],
    ),
}


@pytest.mark.parametrize("name", ON_BRIDGE)
def test_first_cause_behind_a_bridge_with_another_clock(name: str, tmp_path: Path) -> None:
    script = ON_BRIDGE[name]
    topics = {topic: TYPES[topic] for topic in WELL}
    with (
        stamped_bridge(topics, script.ahead_s) as robot,
        live_server(robot.endpoint, tmp_path, CELL) as kiosk,
    ):
        since = time.monotonic()

        def has_run() -> bool:
            for topic, value in WELL.items():
                robot.publish(topic, TYPES[topic], value, time.time())
            return bool(time.monotonic() - since > GAP_S + 1.0 and kiosk.widget("start")["enabled"])

        until(has_run, "the server has run for some time", every_s=0.5)
        at = time.time()
        for sent in script.sent:
            robot.publish(sent.topic, TYPES[sent.topic], sent.data, at + sent.at)
        judge(kiosk, name, script.causes)


# Real nodes behind a real bridge.


class Cell(NamedTuple):
    """The nodes of a cell, and its panel."""

    kiosk: Server
    bridge: Bridge
    controller: RosNode
    guard: RosNode

    def publish(self, topic: str, data: Any) -> None:
        (self.guard if topic == "/guard" else self.controller).publish(topic, {"data": data})

    def fault(self) -> None:
        self.publish("/state", "FAULT")
        self.publish("/no_fault", False)

    def until_locked(self) -> None:
        until(lambda: not self.kiosk.widget("start")["enabled"], "the cell may not start")

    def until_alarm(self, name: str) -> None:
        def is_raised() -> bool:
            return any(a["id"] == name for a in self.kiosk.http.get("/alarms").json()["alarms"])

        until(is_raised, f"{name} is raised")


def guard_opens(cell: Cell) -> None:
    cell.publish("/guard", False)
    cell.fault()


def publisher_ends(cell: Cell) -> None:
    cell.guard.withdraw("/guard")
    cell.until_locked()
    cell.fault()


def node_is_killed(cell: Cell) -> None:
    cell.guard.kill()
    cell.until_locked()
    cell.fault()


def bridge_is_killed(cell: Cell) -> None:
    cell.bridge.kill()
    cell.until_locked()


def guard_opens_while_the_bridge_is_away(cell: Cell) -> None:
    bridge_is_killed(cell)
    cell.bridge.start()

    def has_stopped() -> bool:
        for topic, data in {**WELL, "/guard": False, "/no_fault": False, "/state": "FAULT"}.items():
            cell.publish(topic, data)
        return any(key.startswith("state") for key in stops(cell.kiosk))

    until(has_stopped, "the robot is back, and has a fault", every_s=0.3)


def two_at_once(cell: Cell) -> None:
    cell.publish("/air", False)
    cell.controller.publish("/box", {"data": False})
    cell.fault()


def operator_stops(cell: Cell) -> None:
    cell.controller.subscribe("/stop", "std_msgs/msg/Empty")

    def is_heard() -> bool:
        press(cell.kiosk, "stop")
        return bool(cell.controller.heard("/stop"))

    until(is_heard, "the stop arrives", every_s=0.5)
    cell.publish("/state", "STOPPED")


def group_of_alarms(cell: Cell) -> None:
    for topic, alarm in (("/belt", "belt"), ("/arm", "arm")):
        cell.publish(topic, 3.0)
        cell.until_alarm(alarm)
    cell.fault()


def alarm_with_a_delay(cell: Cell) -> None:
    cell.publish("/heat", 90.0)
    passed(0.7)
    cell.publish("/air", False)
    cell.until_alarm("hot")
    cell.fault()


def box_in_each_cycle(cell: Cell) -> None:
    for _ in range(4):
        for is_there in (False, True):
            cell.publish("/box", is_there)
            passed(1.1)
    cell.publish("/box", False)
    guard_opens(cell)


class OnRobot(NamedTuple):
    play: Callable[[Cell], None]
    causes: Collection[str]


ON_ROBOT: Final[Mapping[str, OnRobot]] = {
    "the guard door is opened": OnRobot(guard_opens, ["guard"]),
    "the publisher of the guard door ends": OnRobot(publisher_ends, ["guard", "/guard"]),
    "the node of the guard door is killed": OnRobot(node_is_killed, ["guard", "/guard", "/guard_plc"]),
    "the bridge is killed": OnRobot(bridge_is_killed, [""]),
    "the guard door is opened while the bridge is away": OnRobot(
        guard_opens_while_the_bridge_is_away, ["guard"]
    ),
    "two values of one node at once": OnRobot(two_at_once, ["air"]),
    "Stop is pressed": OnRobot(operator_stops, ["stop"]),
    "the first of a group of alarms": OnRobot(group_of_alarms, ["belt"]),
    "an alarm with a delay began first": OnRobot(alarm_with_a_delay, ["hot"]),
    "a box is missing in each cycle, then the guard door": OnRobot(box_in_each_cycle, ["guard"]),
}


@pytest.mark.parametrize("name", ON_ROBOT)
def test_first_cause_on_real_nodes(name: str, own_bridge: Bridge, tmp_path: Path) -> None:
    script = ON_ROBOT[name]
    nodes = [RosNode(own_bridge.domain, node) for node in ("cell_controller", "guard_plc")]
    try:
        with live_server(own_bridge, tmp_path, CELL) as kiosk:
            cell = Cell(kiosk, own_bridge, *nodes)
            for topic, type_name in TYPES.items():
                (cell.guard if topic == "/guard" else cell.controller).advertise(topic, type_name)
            since = time.monotonic()

            def has_run() -> bool:
                for topic, data in WELL.items():
                    cell.publish(topic, data)
                return bool(time.monotonic() - since > GAP_S + 1.0 and kiosk.widget("start")["enabled"])

            until(has_run, "the server has run for some time", every_s=0.5)
            script.play(cell)
            judge(kiosk, name, script.causes)
    finally:
        for node in nodes:
            node.end()


# The verdict.


def newest(kiosk: Server) -> str:
    """The key of the newest stop, when there is one."""
    return str(until(lambda: next(iter(stops(kiosk)), None), "it has stopped", within_s=90))


def stops(kiosk: Server) -> list[str]:
    """The keys of the stops, the newest first."""
    text = kiosk.http.get("/stops").text
    return re.findall(r'href="/stops/((?:state|alarm|goal|link)-[0-9]+)"', text)


def judge(kiosk: Server, name: str, causes: Collection[str]) -> None:
    """The story of the newest stop, after its last change, names the cause or says that it can't be
    told."""
    at = stopped_at(kiosk, newest(kiosk))
    until(lambda: time.time() > at + AFTER_S, "all changes of its story have happened")
    key = newest(kiosk)
    began = time.monotonic()
    told = story(kiosk, key)
    until(lambda: time.time() > at + AFTER_S + TOLD_WITHIN_S, "the story is whole")
    again = story(kiosk, key)
    first = again["first_cause"]
    verdict = "can't be told" if first is None else "right" if first["id"] in causes else "WRONG"
    print(f"{verdict}: {name}: {again['sentence']} [{again['not_told']}, by {again['ordered_by']}]")
    assert verdict != "WRONG", again
    assert told["first_cause"] == first, (told, again)
    assert time.monotonic() - began < 60.0


def stopped_at(kiosk: Server, key: str) -> float:
    return datetime.fromisoformat(story(kiosk, key)["stop"]["at"]).timestamp()


def story(kiosk: Server, key: str) -> dict[str, Any]:
    answer = kiosk.http.get(f"/stops/{key}/story.json")
    assert answer.status_code == 200, answer.text
    told: dict[str, Any] = answer.json()
    return told

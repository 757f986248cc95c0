"""An alarm of one robot locks controls of another one."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from app.panel.alarm_places import alarm_place
from app.panel.file.load import load_panel
from app.system.errors import PanelError
from tests.support.parts import ROOT, Server, until
from tests.support.servers import ready

NAMES = ("left", "right")
ROBOT = """
[[robot]]
id = "{name}"
name = "{title} arm"
namespace = "/{name}"
"""
BUTTON = """
[[page.widget]]
id = "{name}"
kind = "publish"
label = "{name}"
topic = "/{name}"
type = "std_msgs/msg/Empty"
message = {{}}
"""
PAGE = """
[[page]]
id = "cell"
title = "Cell"
"""
FENCE = """
[[page.widget]]
id = "fence"
kind = "switch"
label = "Fence"
topic = "/open_fence"
type = "std_msgs/msg/Bool"
on_message = { data = true }
off_message = { data = false }
reported = { topic = "/fence_open", type = "std_msgs/msg/Bool" }
"""
ALARM = """
[[alarm]]
id = "fence_open"
robot = "left"
text = "The fence is open"
action = "Close the fence."
when = {{ topic = "/fence_open", equals = true }}
inhibits = {inhibits}
"""
INHIBITS = '["start", "right/start", "weld"]'


def panel_text(inhibits: str = INHIBITS) -> str:
    robots = "".join(ROBOT.format(name=name, title=name.capitalize()) for name in NAMES)
    weld = BUTTON.format(name="weld").replace("kind", 'robot = "right"\nkind')
    buttons = BUTTON.format(name="start") + BUTTON.format(name="go") + weld
    alarm = ALARM.format(inhibits=inhibits)
    return f'title = "Cell"\nmode = "demo"\n{robots}{PAGE}{FENCE}{buttons}{alarm}'


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    path = tmp_path_factory.mktemp("fence") / "cell.toml"
    path.write_text(panel_text())
    with ready(Server(ROOT, KIOSK_PANEL=str(path))) as server:
        yield server


def locks(server: Server) -> dict[str, list[str]]:
    """The ids of the locked buttons, by the robot whose page is open."""

    def locked(robot: str) -> list[str]:
        shown: dict[str, Any] = server.robot(robot).snapshot()["widgets"]
        return [name for name in ("start", "go", "weld") if not shown[name]["enabled"]]

    return {robot: locked(robot) for robot in NAMES}


def test_an_alarm_locks_the_controls_of_another_robot(cell: Server) -> None:
    left, right = (cell.robot(name) for name in NAMES)
    until(lambda: locks(cell) == {"left": [], "right": []}, "the fence is closed")
    assert right.press("fence", inputs={"fence": True}).status_code == 200
    assert locks(cell) == {"left": [], "right": []}  # the right robot has no such alarm
    assert left.press("fence", inputs={"fence": True}).status_code == 200
    both = {"left": ["start", "weld"], "right": ["start", "weld"]}
    until(lambda: locks(cell) == both, "both robots are locked")
    assert left.widget("start")["reason"] == "Alarm: The fence is open. Close the fence."
    others = "Alarm: The fence is open (Left arm). Close the fence."
    assert (right.widget("start")["reason"], right.widget("weld")["reason"]) == (others, others)
    for robot, name in ((left, "start"), (right, "start"), (left, "weld")):
        refused = robot.press(name, inputs={})
        assert (refused.status_code, refused.json()["code"]) == (409, "alarm_inhibits_action")
    assert right.press("go", inputs={}).json()["outcome"] == "published"
    assert left.press("fence", inputs={"fence": False}).status_code == 200
    until(lambda: locks(cell) == {"left": [], "right": []}, "the fence is closed again")
    assert right.press("start", inputs={}).json()["outcome"] == "published"


@pytest.mark.parametrize(
    ("inhibits", "words"),
    [
        ('["rigth/start"]', 'no robot "rigth"; did you mean "right/start"?'),
        ('["right/strat"]', 'no control "strat"; did you mean "start"?'),
        ('["left/weld"]', '"weld" is a control of "right" alone: write "weld" or "right/weld"'),
        ('["*/weld"]', '"weld" is a control of "right" alone: write "weld" or "right/weld"'),
        ('["right:start"]', 'with a robot\'s id "right/start" or "*/start"'),
    ],
)
def test_a_mistake_names_the_robot_and_the_control(tmp_path: Path, inhibits: str, words: str) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(panel_text(inhibits))
    with pytest.raises(PanelError) as error:
        load_panel(path)
    (fault,) = error.value.faults
    assert (fault.place, words in fault.message) == ("alarm[0].inhibits[0]", True)


def test_a_robot_without_an_id_has_no_other(tmp_path: Path) -> None:
    path = tmp_path / "cell.toml"
    text = panel_text('["right/start"]')
    text = text.replace('robot = "left"\n', "").replace('robot = "right"\n', "")
    path.write_text(text[: text.index("[[robot]]")] + text[text.index("[[page]]") :])
    with pytest.raises(PanelError, match='one robot, without an id: write "start"'):
        load_panel(path)


@pytest.mark.parametrize(
    ("inhibits", "robot", "shown"),
    [
        ('["right/start"]', "left", None),
        ('["*/start"]', "left", "start"),
        ('["right/start"]', "right", "start"),
        ('["weld"]', "left", None),
    ],
)
def test_an_alarm_leads_to_a_control_of_its_own_robot(
    tmp_path: Path, inhibits: str, robot: str, shown: str | None
) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(panel_text(inhibits).replace(FENCE, ""))
    panel = load_panel(path)
    place = alarm_place(panel, panel.alarms[0], robot)
    assert (place and place.widget.id) == shown

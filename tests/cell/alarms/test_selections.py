"""The alarms that widgets show: those of their group, priorities and robot, at each change."""

from pathlib import Path
from typing import Any, Final, cast

from app.cell.alarms.shown import AlarmRow, AlarmSelections
from app.panel import load_panel

PANEL: Final = """
title = "Cell"
[[robot]]
id = "r1"
name = "R1"
namespace = "/r1"
[[robot]]
id = "r2"
name = "R2"
namespace = "/r2"
[[alarm]]
id = "low"
topic = "/air"
type = "std_msgs/msg/Float64"
text = "Low"
low = 5.0
group = "Air"
[[page]]
id = "main"
title = "Main"
[[page.widget]]
id = "air"
kind = "alarm_list"
label = "Air"
group = "Air"
[[page.widget]]
id = "urgent"
kind = "alarm_line"
label = "Urgent"
priorities = [1, 2]
robots = "all"
"""


def alarm(name: str, robot: str = "r1", **changed: Any) -> AlarmRow:
    row = {"id": name, "robot": robot, "group": "Air", "priority": 3, "acknowledged": False}
    row |= {"state": "active", "before_unknown": "active", "follows": ""} | changed
    order = [0, 1.0 if row["acknowledged"] else 0.0, row["priority"], 0.0]
    return cast(AlarmRow, row | {"order": order})


def selections(folder: Path) -> AlarmSelections:
    path = folder / "cell.toml"
    path.write_text(PANEL)
    panel, made = load_panel(path), AlarmSelections()
    for robot in ("r1", "r2"):
        made.add_robot(robot, panel)
    return made


def shown(made: AlarmSelections, robot: str, widget: str) -> list[str]:
    return [row["id"] for row in made.of_robot(robot)[widget].rows]


def test_a_widget_has_the_alarms_of_its_filter_only(tmp_path: Path) -> None:
    made = selections(tmp_path)
    for row in (alarm("a"), alarm("b", "r2", priority=1), alarm("c", group="Oil", priority=2)):
        made.update(None, row)
    assert shown(made, "r1", "air") == ["a"]
    assert shown(made, "r2", "air") == ["b"]
    assert shown(made, "r1", "urgent") == shown(made, "r2", "urgent") == ["b", "c"]
    line = made.of_robot("r1")["urgent"].line
    assert line
    assert line["id"] == "b"


def test_an_alarm_that_no_longer_matches_leaves_and_counts_no_more(tmp_path: Path) -> None:
    made, first = selections(tmp_path), alarm("a", priority=2)
    made.update(None, first)
    made.update(first, second := alarm("a", priority=3, acknowledged=True))
    assert shown(made, "r1", "urgent") == []
    assert made.of_robot("r1")["urgent"].standing == 0
    air = made.of_robot("r1")["air"]
    assert (air.standing, air.unacknowledged, air.line) == (1, 0, None)
    made.update(second, None)
    assert made.of_robot("r1")["air"] == ((None, (), 0, 0, 0, 0))

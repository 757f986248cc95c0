"""The other robots on a map: each by its own topics, only on the map that it has itself."""

from types import SimpleNamespace as Message
from typing import Any, Final

import pytest

from app.cell.robot.maps import GRID_TYPE, read_grid
from app.cell.view.map_robots import has_only_moved, other_robots, robot_on_map
from app.cell.view.view import FAILED
from tests.cell.view.test_map_values import INFO, moved, robot_with, shown
from tests.support.builders import INTERFACES, NOW
from tests.support.words import english

LATER: Final = NOW + 6.2


def map_of(x: float | None = 1.0, *, now: float = NOW, **message: Any) -> Any:
    """What the map of a robot shows that was at `x` at `NOW`; `message` has other fields of its map."""
    panel, robot = robot_with(robots="all")
    if message:
        content = {"header": {"frame_id": "map"}, "info": INFO, "data": [0, 100]} | message
        robot.maps["map"].grid = read_grid(INTERFACES, INTERFACES.encode(GRID_TYPE, content))
        if frame := message.get("header", {}).get("frame_id"):
            robot.transforms.record(_transform(frame), NOW, is_static=True)
    if x is not None:
        moved(robot, x)
    return shown(panel, robot, now)


def _transform(frame: str) -> Any:
    way = Message(
        translation=Message(x=0.0, y=0.0, z=0.0), rotation=Message(x=0.0, y=0.0, z=0.0, w=1.0)
    )
    stamp = Message(sec=1, nanosec=0)
    header = Message(frame_id=frame, stamp=stamp)
    return Message(transforms=[Message(header=header, child_frame_id="map", transform=way)])


def on(own: Any, other: Any) -> tuple[dict[str, Any], str]:
    """The row of another robot on a map, and the note under the map."""
    attributes = english(other_robots(own, [("r2", "Robot 2", robot_on_map(other))]))
    (row,) = attributes["robots"]
    return row, attributes["robots_note"]


def test_another_robot_is_where_its_own_transforms_say() -> None:
    row, note = on(map_of(), map_of(3.5))
    assert row == {
        "robot": "r2",
        "name": "Robot 2",
        "label": "Robot 2",
        "state": "live",
        "pose": [3.5, 2.0, 0.0],
        "level": "",
        "note": "",
    }
    assert note == ""


def test_an_old_robot_has_its_own_age() -> None:
    row, note = on(map_of(), map_of(3.5, now=LATER))
    assert (row["state"], row["label"], row["pose"]) == ("old", "Robot 2, 6 s ago", [3.5, 2.0, 0.0])
    assert row["note"] == "The robot was here 6 s ago. Its position now is not known."
    assert note == ""


def test_a_robot_whose_link_is_lost_is_not_shown_as_live() -> None:
    panel, robot = robot_with(robots="all")
    moved(robot, 3.5)
    robot.transforms.cut(NOW)
    row, _ = on(map_of(), shown(panel, robot, LATER))
    assert (row["state"], row["label"]) == ("old", "Robot 2, 6 s ago")


def test_a_robot_whose_map_is_in_doubt_is_not_shown_as_live() -> None:
    panel, robot = robot_with(robots="all")
    moved(robot, 3.5)
    robot.maps["map"].doubt = "Updates of the map were lost"
    row, _ = on(map_of(), shown(panel, robot))
    assert (row["state"], row["label"]) == ("old", "Robot 2")


@pytest.mark.parametrize(
    ("other", "words"),
    [
        ({"data": [0, 0]}, "Has another map"),
        ({"info": INFO | {"resolution": 0.25}}, "Has another map"),
        ({"header": {"frame_id": "hall"}}, "Has another map"),
        ({"x": None}, "No transform from map to base_link: base_link is missing"),
    ],
)
def test_a_robot_elsewhere_is_left_out_and_named(other: dict[str, Any], words: str) -> None:
    row, note = on(map_of(), map_of(**other))
    assert (row["state"], row["pose"], row["label"]) == ("absent", None, "Robot 2")
    assert (row["note"], note) == (words, f"Robot 2: {words}")


def test_a_robot_without_a_map_is_left_out_and_named() -> None:
    panel, robot = robot_with(robots="all")
    robot.maps["map"].grid = None
    row, note = on(map_of(), shown(panel, robot))
    assert (row["state"], row["pose"]) == ("absent", None)
    assert note == "Robot 2: Waiting for the robot's map"


def test_a_robot_whose_map_fails_does_not_harm_the_others() -> None:
    row, _ = on(map_of(), FAILED)
    assert (row["state"], row["note"]) == ("absent", english(FAILED["note"]))
    row, note = on(FAILED, map_of())
    assert (row["state"], row["pose"], row["note"], note) == ("absent", None, "", "")


def test_the_list_has_each_robot_while_the_map_has_not_come() -> None:
    panel, robot = robot_with(robots="all")
    robot.maps["map"].grid = None
    row, note = on(shown(panel, robot), map_of())
    assert (row["robot"], row["state"], row["pose"], note) == ("r2", "absent", None, "")


def test_what_gets_old_or_is_gone_is_shown_at_once() -> None:
    here = robot_on_map(map_of())
    assert has_only_moved(here, robot_on_map(map_of(3.5)))
    changed = (map_of(now=LATER), map_of(None), map_of(data=[0, 0]), FAILED)
    assert [has_only_moved(here, robot_on_map(each)) for each in changed] == [False] * 4


def test_several_left_out_are_all_named() -> None:
    absent = robot_on_map(map_of(None))
    rows = [("r2", "Robot 2", absent), ("r3", "Robot 3", absent)]
    note = english(other_robots(map_of(), rows))["robots_note"]
    assert "Robot 2: " in note
    assert "Robot 3: " in note


def test_a_map_of_one_robot_has_no_attributes_of_others() -> None:
    panel, robot = robot_with()
    assert not {"robots", "robots_note", "age"} & {*shown(panel, robot)}

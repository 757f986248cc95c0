"""The other robots on a map of several: pure, from what the same map shows on a page of each."""

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from app.panel.widgets.map_view import MapView
from app.system.texts import TextLike, joined, say


class RobotOnMap(NamedTuple):
    """Where a robot is on its own map: `version` is that map's, "" without one, and `pose` is x and y
    in metres and yaw in radians, None if unknown. `state` and `note` are the map's, `age` is how old
    the pose is, "" while it is not."""

    state: str
    note: TextLike
    age: TextLike
    version: str
    pose: list[float] | None


def without_others(widget: MapView, age: TextLike) -> dict[str, Any]:
    """Attributes of a map that is to have other robots: `age` of the pose of its own robot, no others
    yet."""
    return {"age": age, "robots": [], "robots_note": ""} if widget.robots == "all" else {}


def robot_on_map(shown: Mapping[str, Any]) -> RobotOnMap:
    """Where a robot is, from the attributes of the map on its page; nowhere if that can't be shown."""
    grid = shown.get("grid")
    if grid is None:
        return RobotOnMap(shown["state"], shown["note"], "", "", None)
    return RobotOnMap(shown["state"], shown["note"], shown["age"], grid["version"], shown["pose"])


def has_only_moved(before: RobotOnMap, after: RobotOnMap) -> bool:
    """Whether a robot is only elsewhere, or older, than before: that may be shown a little later."""
    states = [(each.state, each.version, each.pose is None) for each in (before, after)]
    return states[0] == states[1]


def other_robots(
    shown: Mapping[str, Any], others: Iterable[tuple[str, TextLike, RobotOnMap]]
) -> dict[str, Any]:
    """Attributes of a map that shows `others`, by their ids and names: `robots`, a row for each, and
    `robots_note`, which names those that are not drawn and says why. A robot is drawn only on the map
    that it has itself: the version of a map is that of its cells, its place and its frame."""
    grid = shown.get("grid")
    levels = {row["grid"]["version"]: row for row in shown.get("levels", ()) if row["grid"]}
    rows = [_row(grid["version"] if grid else "", levels, *other) for other in others]
    if not grid:  # the map says itself what is wrong
        return {"robots": rows, "robots_note": ""}
    absent = [row for row in rows if row["state"] == "absent"]
    notes = [say("map_robot_note", name=row["name"], note=row["note"]) for row in absent]
    return {"robots": rows, "robots_note": joined(notes)}


def _row(
    version: str,
    levels: Mapping[str, Mapping[str, Any]],
    robot: str,
    name: TextLike,
    position: RobotOnMap,
) -> dict[str, Any]:
    """`state` is live, old or absent; `label` stands at the robot on the map. `level` is the id of the
    level that it is on, "" without levels. `levels` are by the versions of their maps."""
    row = {"robot": robot, "name": name, "label": name, "state": "absent", "pose": None, "level": ""}
    on = levels.get(position.version)
    if on is None and version and position.version and position.version != version:
        return row | {"note": say("map_robot_elsewhere")}
    if not (version or on) or not position.version or position.pose is None:
        return row | {"note": position.note}
    label = say("map_robot_age", name=name, age=position.age) if position.age else name
    state = "live" if position.state == "live" else "old"
    note = position.note
    if on is not None:
        row, note = row | {"level": on["id"]}, note or say("map_robot_level", level=on["label"])
    return row | {"label": label, "state": state, "note": note, "pose": position.pose}

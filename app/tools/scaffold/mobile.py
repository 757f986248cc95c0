"""The page of a robot that drives: its map, battery, places and the actions of Nav2. Pure."""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

from app.panel.widgets.map_layers import LAYERS, LayerName
from app.panel.widgets.map_view import POSE_PATHS, TF_TYPE
from app.ros.graph.model import Server, SurveyedTopic
from app.ros.messages import Interfaces
from app.tools.scaffold.parts import DraftWidget, id_of, label_of, words_of

MAP_PAGE: Final = "map"
GRID: Final = "nav_msgs/msg/OccupancyGrid"
BATTERY: Final = "sensor_msgs/msg/BatteryState"
NAV2: Final = "nav2_msgs/action/"
MAP_TOPIC: Final = "/map"  # that a map shows if it names none
# Of several poses the one that a localization corrects comes first.
POSE_NAMES: Final = ("amcl_pose", "pose")
# What the name of a layer's topic must have, and how many of a kind there are at most.
LAYER_WORDS: Final[Mapping[LayerName, str]] = {
    "footprint": "footprint",
    "covariance": "pose",
    "costmap": "costmap",
}
MOST_ALIKE: Final[Mapping[LayerName, int]] = {"path": 2, "costmap": 2}
# The actions of Nav2 that are for operators. The others are those of its own servers.
ACTIONS: Final[Mapping[str, str]] = {
    f"{NAV2}{name}": comment
    for name, comment in {
        "NavigateToPose": "Drives to what is chosen in the input goal.",
        "NavigateThroughPoses": "Drives through poses. Fill in the poses, in the frame of the map.",
        "FollowWaypoints": "Drives to poses, one after the other. Fill in the poses.",
        "DockRobot": "Drives to a dock. Give the name that it has in the file of docks.",
        "UndockRobot": "Leaves the dock.",
    }.items()
}
OF_NAV2: Final = "an action between Nav2's own servers: send goals to its navigator"
NAVIGATE: Final = f"{NAV2}NavigateToPose"
GOAL: Final = "goal"  # the input for a goal
# The actions whose goals a tour shows, the first that the robot has.
THROUGH_POSES: Final = (f"{NAV2}FollowWaypoints", f"{NAV2}NavigateThroughPoses")
TOUR: Final = "waypoints"
TOUR_COMMENT: Final = (
    "The poses of a goal, and where the robot is on the way. To send one: places with the ids of"
    ' [[place]] tables here, and goal = { poses = "{waypoints.poses}" } there.'
)
GOALS: Final[Mapping[str, Mapping[str, Any]]] = {
    f"{NAV2}NavigateToPose": {
        "goal": {
            "pose": {"header": {"frame_id": "{goal.frame}", "stamp": "{now}"}, "pose": "{goal.pose}"}
        },
        "progress": "distance_remaining",
        "progress_falls": True,
        "feedback": "{distance_remaining:.1f} m left",
    },
    f"{NAV2}DockRobot": {"goal": {"dock_id": "dock"}},
}


def main_map(topics: Iterable[SurveyedTopic]) -> SurveyedTopic | None:
    """The map that the robot drives on: a grid with the word `map` at the end of its name, the
    shortest; None of a robot without one."""
    maps = [
        topic
        for topic in topics
        if topic.publishers and topic.types == (GRID,) and words_of(topic.name)[-1:] == ["map"]
    ]
    return min(maps, key=lambda topic: (len(topic.name), topic.name), default=None)


def map_widgets(topics: Sequence[SurveyedTopic]) -> Iterator[DraftWidget]:
    """The map of a robot that drives; nothing without a map."""
    chosen = main_map(topics)
    if chosen is None:
        return
    keys: dict[str, Any] = {"label": label_of(chosen.name)}
    keys |= {"topic": chosen.name} if chosen.name != MAP_TOPIC else {}
    pose = None if _has_transforms(topics) else _pose_topic(topics)
    if pose is not None:
        keys["pose"] = {"topic": pose.name, "type": pose.type}
    if layers := [_layer(*layer) for layer in _layers(topics)]:
        keys["layer"] = layers
    comment = (
        f"The robot is where {pose.name} says."
        if pose is not None
        else "The robot is where its transforms say: base_link, or what base_frame names."
    )
    yield DraftWidget(
        kind="map", name=chosen.name, place=(MAP_PAGE,), keys={**keys, "span": 12}, comment=comment
    )


def of_map(topics: Sequence[SurveyedTopic]) -> Collection[str]:
    """The names of the topics that the map shows: no other widget needs them."""
    chosen = main_map(topics)
    if chosen is None:
        return ()
    transforms = (topic.name for topic in topics if topic.types == (TF_TYPE,))
    drawn = (topic.name for topic, _ in _layers(topics))
    return (chosen.name, *transforms, *drawn)


def _layers(topics: Iterable[SurveyedTopic]) -> Iterator[tuple[SurveyedTopic, LayerName]]:
    """The topics that are drawn over the map, by their types and names; `MOST_ALIKE` of a kind."""
    published = sorted((topic for topic in topics if topic.publishers), key=lambda topic: topic.name)
    for name, kind in LAYERS.items():
        if kind.is_mask:
            continue  # which filter a mask is of, only a person knows
        word = LAYER_WORDS.get(name, "")
        alike = [
            topic for topic in published if topic.types == (kind.type,) and word in topic.name.lower()
        ]
        yield from ((topic, name) for topic in alike[: MOST_ALIKE.get(name, 1)])


def _layer(topic: SurveyedTopic, name: LayerName) -> dict[str, Any]:
    keys = {"shows": name, "topic": topic.name, "label": label_of(_said(topic.name))}
    return keys if topic.reliable else {**keys, "qos": {"reliability": "best_effort"}}


def _said(name: str) -> str:
    """A costmap is known by the namespace that it is in."""
    return name.removesuffix("/costmap") if name.endswith("_costmap/costmap") else name


def _has_transforms(topics: Iterable[SurveyedTopic]) -> bool:
    return any(topic.types == (TF_TYPE,) and topic.publishers for topic in topics)


def _pose_topic(topics: Iterable[SurveyedTopic]) -> SurveyedTopic | None:
    """A pose of the robot; odometry only if there is no other, as its frame is seldom the map's."""

    def rank(topic: SurveyedTopic) -> tuple[int, str]:
        last = topic.name.rpartition("/")[2]
        own = POSE_NAMES.index(last) if last in POSE_NAMES else len(POSE_NAMES)
        return own + (topic.type == "nav_msgs/msg/Odometry"), topic.name

    poses = (topic for topic in topics if topic.publishers and {*topic.types} <= {*POSE_PATHS})
    return min(poses, key=rank, default=None)


def is_of_map_page(entry: DraftWidget) -> bool:
    """Whether a widget belongs beside the map: the battery, the joystick, the actions of Nav2."""
    kind = entry.keys.get("type", "")
    return entry.kind in ("map", "joystick") or kind == BATTERY or kind in ACTIONS


def on_map_page(entries: Iterable[DraftWidget]) -> Iterator[DraftWidget]:
    """The entries; those that belong beside the map are on its page, with an input for goals on it. A
    robot without a map has no such input."""
    entries = list(entries)
    shown = next((entry for entry in entries if entry.kind == "map"), None)
    if shown is None:
        yield from map(_without_input, entries)
        return
    for entry in entries:
        yield replace(entry, place=(MAP_PAGE,)) if is_of_map_page(entry) else entry
    map_id = id_of(shown.name, ())
    by_type = {str(entry.keys.get("type")): entry for entry in reversed(entries)}
    if (navigator := by_type.get(NAVIGATE)) is not None:
        yield replace(
            navigator,
            kind="place",
            name=GOAL,
            keys={"label": "Goal", "map": map_id, "touch": True},
            comment="Places of [[place]] tables, or a pose that is touched on the map.",
            place=(MAP_PAGE,),
            is_input=True,
        )
    follower = next((by_type[kind] for kind in THROUGH_POSES if kind in by_type), None)
    if follower is not None:
        action = id_of(follower.name, ())
        yield replace(
            follower,
            kind="tour",
            name=TOUR,
            keys={"label": "Waypoints", "map": map_id, "action": action},
            comment=TOUR_COMMENT,
            place=(MAP_PAGE,),
            is_input=True,
        )


def _without_input(entry: DraftWidget) -> DraftWidget:
    if entry.keys.get("type") != NAVIGATE:
        return entry
    header = {"frame_id": "map", "stamp": "{now}"}
    comment = "Drives to a pose. Fill in the pose, in the frame of the map."
    return replace(entry, keys={**entry.keys, "goal": {"pose": {"header": header}}}, comment=comment)


def nav2_goal(action: Server, interfaces: Interfaces) -> tuple[Mapping[str, Any], str] | None:
    """The keys of a goal of Nav2, and a comment; None for any other action. InterfaceError of a type
    that is not known."""
    if action.type not in ACTIONS:
        return None
    interfaces.action_types(action.type)
    return GOALS.get(action.type, {}), ACTIONS[action.type]


def is_internal(action: Server) -> bool:
    """Whether an action is one between Nav2's own servers."""
    return action.type.startswith(NAV2) and action.type not in ACTIONS

"""The story `driving`: a mobile robot in a hall, with the names of Nav2: topics, commands and actions.
Pure, stepped with time.

Source: nav2_msgs (NavigateToPose, DockRobot, UndockRobot), REP 105 (frames),
sensor_msgs/msg/BatteryState.
"""

import math
from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache
from typing import Any, Final, NamedTuple

from app.panel.demo import Story
from app.ros.messages import Interfaces
from app.tools.simulator.hall import (
    COLUMNS,
    ORIGIN,
    RESOLUTION,
    ROWS,
    Point,
    hall,
)
from app.tools.simulator.known_types import Moment, stamp
from app.tools.simulator.mobile_robot import (
    COLLISION_SLOW,
    COLLISION_STOP,
    HALF_LENGTH,
    HALF_WIDTH,
    OBSTACLE_M,
    SPEED_M_S,
    MobileRobot,
    Obstacle,
    Pose,
    Task,
)
from app.tools.simulator.parameters import NodeParameters
from app.tools.simulator.robot import (
    CANCEL_OK,
    CANCEL_TOO_LATE,
    CANCEL_UNKNOWN,
    CANCELED,
    EVERY_GOAL,
    EXECUTING,
    KEPT_GOALS,
    SUCCEEDED,
)
from app.tools.simulator.story import (
    Fields,
    PlayedStory,
    StoryTopic,
    StoryTopics,
    diagnostic_status,
    log_fields,
)

# What the robot publishes: a row for each topic, with the fields of its message. Pure.

OFTEN_S: Final = 0.1  # between the messages of what moves
SCAN_S: Final = 0.2
BEAMS: Final = 180
LIDAR_M: Final = 12.0
LIDAR_AHEAD: Final = 0.3
COSTMAP_CELLS: Final = 60
INFLATION_M: Final = 0.8
OK, WARN = 0, 1
POLYGONS: Final = {COLLISION_STOP: "PolygonStop", COLLISION_SLOW: "PolygonSlow"}
CHARGING, DISCHARGING, NOT_CHARGING, FULL = 1, 2, 3, 4


def _header(moment: Moment, frame: str) -> Fields:
    return {"stamp": stamp(moment), "frame_id": frame}


def _orientation(yaw: float) -> Fields:
    return {"x": 0.0, "y": 0.0, "z": math.sin(yaw / 2), "w": math.cos(yaw / 2)}


def _pose(pose: Pose) -> Fields:
    position = {"x": pose.x, "y": pose.y, "z": 0.0}
    return {"position": position, "orientation": _orientation(pose.yaw)}


def _transform(parent: str, child: str, pose: Pose, moment: Moment) -> Fields:
    moved = {"x": pose.x, "y": pose.y, "z": 0.0}
    way = {"translation": moved, "rotation": _orientation(pose.yaw)}
    return {"header": _header(moment, parent), "child_frame_id": child, "transform": way}


def _transforms(poses: tuple[Pose, Pose], moment: Moment) -> Fields:
    odom, base = poses
    ways = (("map", "odom", odom), ("odom", "base_link", base))
    return {"transforms": [_transform(*way, moment) for way in ways]}


def _static(_: None, moment: Moment) -> Fields:
    lidar = _transform("base_link", "lidar", Pose(LIDAR_AHEAD, 0.0, 0.0), moment)
    return {"transforms": [lidar]}


def _map(_: None, moment: Moment) -> Fields:
    cells = [cell if cell <= 100 else -1 for cell in hall().cells]
    return {
        "header": _header(moment, "map"),
        "info": {**_info(COLUMNS, ROWS, Pose(*ORIGIN, 0.0)), "map_load_time": stamp(moment)},
        "data": cells,
    }


def _info(width: int, height: int, origin: Pose) -> Fields:
    about = {"resolution": RESOLUTION, "width": width, "height": height}
    return {**about, "origin": _pose(origin)}


def _located(value: tuple[Pose, float], moment: Moment) -> Fields:
    pose, deviation = value
    covariance = [0.0] * 36
    covariance[0], covariance[7] = deviation**2, (1.4 * deviation) ** 2
    covariance[35] = (deviation / 4) ** 2
    located = {"pose": _pose(pose), "covariance": covariance}
    return {"header": _header(moment, "map"), "pose": located}


def _odometry(value: tuple[Pose, float, float], moment: Moment) -> Fields:
    pose, speed, turning = value
    return {
        "header": _header(moment, "odom"),
        "child_frame_id": "base_link",
        "pose": {"pose": _pose(pose)},
        "twist": {"twist": {"linear": {"x": speed}, "angular": {"z": turning}}},
    }


class Seen(NamedTuple):
    """What the lidar's beams depend on."""

    pose: Pose
    obstacle: Point | None


def _seen(robot: MobileRobot) -> Seen:
    return Seen(_rounded(robot.pose), None if robot.obstacle is None else robot.obstacle.at)


@lru_cache(4)  # of a robot that stands
def _ranges(seen: Seen) -> list[float]:
    """The beams of the lidar, from its back around."""
    eye = seen.pose.then(Pose(LIDAR_AHEAD, 0.0, 0.0))
    angles = (eye.yaw - math.pi + beam * 2 * math.pi / BEAMS for beam in range(BEAMS))
    return [round(_range(seen.obstacle, eye, angle), 2) for angle in angles]


def _range(obstacle: Point | None, eye: Pose, angle: float) -> float:
    wall = hall().beam(eye.x, eye.y, angle, LIDAR_M)
    if obstacle is not None:
        dx, dy = obstacle[0] - eye.x, obstacle[1] - eye.y
        ahead = dx * math.cos(angle) + dy * math.sin(angle)
        beside = abs(dy * math.cos(angle) - dx * math.sin(angle))
        if ahead > 0 and beside < OBSTACLE_M:
            wall = min(wall, ahead - math.sqrt(OBSTACLE_M**2 - beside**2))
    return wall if wall < LIDAR_M else math.inf


def _scan(seen: Seen, moment: Moment) -> Fields:
    step = 2 * math.pi / BEAMS
    return {
        "header": _header(moment, "lidar"),
        "angle_min": -math.pi,
        "angle_max": math.pi - step,
        "angle_increment": step,
        "scan_time": SCAN_S,
        "range_min": 0.05,
        "range_max": LIDAR_M,
        "ranges": _ranges(seen),
    }


def _plan(points: list[Point], moment: Moment) -> Fields:
    poses = [{"header": _header(moment, "map"), "pose": _pose(Pose(x, y, 0.0))} for x, y in points]
    return {"header": _header(moment, "map"), "poses": poses}


def _footprint(base: Pose, moment: Moment) -> Fields:
    corners = ((1, 1), (1, -1), (-1, -1), (-1, 1))
    points = (base.then(Pose(x * HALF_LENGTH, y * HALF_WIDTH, 0.0)) for x, y in corners)
    polygon = {"points": [{"x": point.x, "y": point.y, "z": 0.0} for point in points]}
    return {"header": _header(moment, "odom"), "polygon": polygon}


def _costmap(value: tuple[Pose, Pose, Obstacle | None], moment: Moment) -> Fields:
    """Costs around the robot, in the frame `odom`: inflated, as Nav2 publishes them (0 to 100)."""
    odom, base, obstacle = value
    side = COSTMAP_CELLS * RESOLUTION
    corner = Pose(round(base.x - side / 2, 1), round(base.y - side / 2, 1), 0.0)
    cells = []
    for row in range(COSTMAP_CELLS):
        for column in range(COSTMAP_CELLS):
            at = odom.then(
                Pose(corner.x + (column + 0.5) * RESOLUTION, corner.y + (row + 0.5) * RESOLUTION, 0.0)
            )
            cells.append(_cost(at, obstacle))
    info = _info(COSTMAP_CELLS, COSTMAP_CELLS, corner)
    return {"header": _header(moment, "odom"), "info": info, "data": cells}


def _cost(at: Pose, obstacle: Obstacle | None) -> int:
    free = hall().clearance(at.x, at.y)
    if obstacle is not None:
        free = min(free, math.dist(obstacle.at, at[:2]) - OBSTACLE_M)
    if free <= 0:
        return 100
    return 0 if free >= INFLATION_M else round(98 * (1 - free / INFLATION_M))


def _battery(value: tuple[float, int, float], moment: Moment) -> Fields:
    charge, status, current = value
    voltage = 22.0 + 6.4 * charge
    return {
        "header": _header(moment, "base_link"),
        "voltage": voltage,
        "temperature": 31.0,
        "current": current,
        "charge": 40 * charge,
        "capacity": 39.2,
        "design_capacity": 40.0,
        "percentage": charge,
        "power_supply_status": status,
        "power_supply_health": 1,
        "power_supply_technology": 2,
        "present": True,
        "cell_voltage": [voltage / 7] * 7,
        "location": "base",
    }


def _supply(robot: MobileRobot) -> tuple[float, int, float]:
    charge = round(robot.charge, 3)
    if robot.is_docked and robot.task is None:
        is_full = robot.charge >= 1.0
        return charge, FULL if is_full else CHARGING, 0.2 if is_full else 22.0
    return charge, DISCHARGING, -5.1 if robot.moves else -1.3


def _parts(robot: MobileRobot) -> list[Fields]:
    does = "drives" if robot.moves else "stands"
    way = {"remaining": f"{robot.remaining:.1f} m"} if robot.task else {}
    return [
        diagnostic_status(OK, "Drive", does, {"speed": f"{robot.speed:.1f} m/s"}),
        diagnostic_status(OK, "Lidar", "5 Hz", {}),
        diagnostic_status(OK, "Localization", f"± {100 * robot.uncertainty:.0f} cm", {"frame": "map"}),
        diagnostic_status(OK, "Navigation", robot.state.lower(), way),
    ]


def _speed_limit(percent: float, moment: Moment) -> Fields:
    return {"header": _header(moment, "map"), "percentage": True, "speed_limit": percent}


def _collision(action: int, _: Moment) -> Fields:
    return {"action_type": action, "polygon_name": POLYGONS.get(action, "")}


RobotTopic = StoryTopic[MobileRobot]


def _rounded(pose: Pose) -> Pose:
    """To a millimetre: what is less is no movement."""
    return Pose(round(pose.x, 3), round(pose.y, 3), round(pose.yaw, 4))


TOPICS: Final[Mapping[str, RobotTopic]] = {
    "/map": RobotTopic(lambda _: None, _map, repeat_s=math.inf),
    "/tf": RobotTopic(
        lambda robot: (_rounded(robot.odom), _rounded(robot.by_odometry)),
        _transforms,
        least_s=OFTEN_S,
        latched=False,
        repeat_s=0.5,
    ),
    "/tf_static": RobotTopic(lambda _: None, _static, repeat_s=math.inf),
    "/amcl_pose": RobotTopic(
        lambda robot: (_rounded(robot.pose), round(robot.uncertainty, 2)), _located, least_s=0.5
    ),
    "/scan": RobotTopic(_seen, _scan, least_s=SCAN_S, latched=False, repeat_s=0.5),
    "/odom": RobotTopic(
        lambda robot: (_rounded(robot.by_odometry), robot.speed, robot.turning),
        _odometry,
        least_s=OFTEN_S,
        latched=False,
        repeat_s=0.5,
    ),
    "/plan": RobotTopic(lambda robot: robot.route, _plan, least_s=1.0, latched=False),
    "/local_costmap/published_footprint": RobotTopic(
        lambda robot: _rounded(robot.by_odometry), _footprint, least_s=SCAN_S, latched=False
    ),
    "/local_costmap/costmap": RobotTopic(
        lambda robot: (robot.odom, _rounded(robot.by_odometry), robot.obstacle),
        _costmap,
        least_s=1.0,
        repeat_s=5.0,
    ),
    "/battery_state": RobotTopic(_supply, _battery, least_s=1.0, latched=False),
    "/battery_hours_left": RobotTopic(lambda robot: round(robot.hours_left, 1)),
    "/robot_state": RobotTopic(lambda robot: robot.state.value),
    "/robot_mode": RobotTopic(lambda robot: "MANUAL" if robot.is_manual else "AUTO"),
    "/robot_place": RobotTopic(lambda robot: robot.place),
    "/moving": RobotTopic(lambda robot: robot.moves or robot.task is not None),
    "/docked": RobotTopic(lambda robot: robot.is_docked),
    "/way_blocked": RobotTopic(lambda robot: robot.is_blocked),
    "/obstacle": RobotTopic(lambda robot: robot.has_visitors_obstacle),
    "/speed_limit": RobotTopic(lambda robot: robot.limit, _speed_limit),
    "/collision_monitor_state": RobotTopic(lambda robot: robot.collision, _collision),
    "/safety/estop_released": RobotTopic(lambda _: True),
    "/diagnostics": RobotTopic(
        _parts,
        lambda statuses, moment: {"header": _header(moment, ""), "status": statuses},
        least_s=1.0,
        latched=False,
    ),
}


# The action servers of the robot: pure.

ABORTED: Final = 6  # action_msgs/msg/GoalStatus
FEEDBACK_S: Final = 0.5


class RobotAction:
    """An action of the robot: one goal at a time; a new one is in place of the old one, where `begin`
    takes it. `result` has the fields that the definition of the action has on this distribution."""

    def __init__(
        self,
        robot: MobileRobot,
        type_name: str,
        interfaces: Interfaces,
        begin: Callable[[Any], Task | None],
        feedback: Callable[[Task], Fields],
    ) -> None:
        types = interfaces.action_types(type_name)
        self.type = type_name
        self._known = {field.name for field in interfaces.structures[types.result].fields}
        self._robot = robot
        self._begin = begin
        self._feedback = feedback
        self._goals: dict[bytes, Task] = {}
        self._states: dict[bytes, int] = {}
        self._told_at = -math.inf

    def step(self) -> None:
        """The state of goals whose tasks have ended."""
        for goal_id, task in self._goals.items():
            if self._states[goal_id] == EXECUTING and task.has_ended:
                self._states[goal_id] = ABORTED if task.code else SUCCEEDED

    def begin(self, goal_id: bytes, goal: Any) -> bool:
        if goal_id in self._goals or (task := self._begin(goal)) is None:
            return False
        self._goals[goal_id], self._states[goal_id] = task, EXECUTING
        self._told_at = -math.inf
        for old in list(self._goals)[:-KEPT_GOALS]:
            if self._states[old] != EXECUTING:
                del self._goals[old], self._states[old]
        return True

    def cancel(self, goal_id: bytes) -> tuple[int, list[bytes]]:
        running = [goal for goal, state in self._states.items() if state == EXECUTING]
        if goal_id != EVERY_GOAL:
            if goal_id not in self._goals:
                return CANCEL_UNKNOWN, []
            if goal_id not in running:
                return CANCEL_TOO_LATE, []
            running = [goal_id]
        for canceled in running:
            if self._robot.task is self._goals[canceled]:
                self._robot.cancel()
            self._states[canceled] = CANCELED
        return CANCEL_OK, running

    def feedback(self) -> list[tuple[bytes, Fields]]:
        now = self._robot.t
        if now - self._told_at < FEEDBACK_S - 1e-6:
            return []
        running = [
            (goal_id, self._feedback(task))
            for goal_id, task in self._goals.items()
            if self._states[goal_id] == EXECUTING and not task.has_ended
        ]
        self._told_at = now if running else self._told_at
        return running

    def states(self) -> list[tuple[bytes, int]]:
        return list(self._states.items())

    def result(self, goal_id: bytes) -> tuple[int, Fields] | None:
        if (task := self._goals.get(goal_id)) is None:
            return 0, {}
        status = self._states[goal_id]
        if status == EXECUTING:
            return None
        ended: Fields = {
            "error_code": task.code,
            "error_msg": task.message,
            "success": not task.code,
            "missed_waypoints": [
                {"index": stop, "error_code": code} for stop, code in sorted(task.missed.items())
            ],
        }
        return status, {name: value for name, value in ended.items() if name in self._known}


def _duration(seconds: float) -> Fields:
    whole = int(seconds)
    return {"sec": whole, "nanosec": int((seconds - whole) * 1e9)}


# The robot as a part of a simulated robot: its messages and commands. Pure.

NAVIGATE: Final = "/navigate_to_pose"
LOG: Final = "/rosout"
CONTROLLER: Final = "/controller_server"
SPEED_PARAMETER: Final = "FollowPath.desired_linear_vel"  # of the regulated pure pursuit controller


class PlayedDriving(PlayedStory):
    """The story, for the `names` that the panel uses."""

    def __init__(self, names: Story, seed: int, interfaces: Interfaces) -> None:
        super().__init__(names)
        self.robot = MobileRobot(seed)
        self._topics = StoryTopics(self.robot, TOPICS)
        self._now = Moment(0.0, 0)
        begin: Mapping[str, tuple[Callable[[Any], Task | None], Callable[[Task], Fields]]] = {
            NAVIGATE: (self._navigate, self._way),
            "/navigate_through_poses": (
                lambda goal: self._tour(goal, goes_on=False),
                lambda task: {
                    **self._way(task),
                    "number_of_poses_remaining": task.stops - task.stop,
                },
            ),
            "/follow_waypoints": (
                lambda goal: self._tour(goal, goes_on=True),
                lambda task: {"current_waypoint": min(task.stop, task.stops - 1)},
            ),
            "/dock_robot": (self._dock, self._docking),
            "/undock_robot": (lambda _: self.robot.undock(), lambda _: {}),
        }
        self._servers = {
            name: RobotAction(self.robot, kind, interfaces, *begin[name])
            for name, kind in names.actions.items()
        }
        self.actions = self._servers

    def is_latched(self, topic: str) -> bool:
        return self._topics.is_latched(topic)

    def configure(self, nodes: Mapping[str, NodeParameters]) -> None:
        """It drives at the speed that a parameter of Nav2's controller sets."""
        if CONTROLLER in nodes:
            self.robot.speed_m_s = nodes[CONTROLLER].value(SPEED_PARAMETER, SPEED_M_S)

    def receive(self, topic: str, message: Any) -> None:
        match topic:
            case "/stop":
                self.robot.stop()
            case "/cmd_vel_teleop":
                self.robot.teleop(message.twist.linear.x, message.twist.angular.z)
            case "/initialpose":
                self.robot.set_pose(_read_pose(message.pose.pose))
            case "/speed_limit":
                self.robot.limit_speed(message.speed_limit, is_percentage=message.percentage)

    def serve(self, service: str, request: Any) -> Fields:
        set_it = {"/manual_mode": self._set_manual, "/obstacle": self._put_obstacle}[service]
        refused = set_it(request.data)
        return {"success": not refused, "message": refused}

    def step(self, moment: Moment) -> Iterator[tuple[str, Fields]]:
        self._now = moment
        self.robot.step(moment.t)
        for server in self._servers.values():
            server.step()
        for level, text in self.robot.notes():
            if LOG in self.names.publishes:
                yield LOG, log_fields(level, text, moment, "bt_navigator")
        for topic in self.names.publishes:
            if (fields := self._topics.due(topic, moment)) is not None:
                yield topic, fields

    def _set_manual(self, on: bool) -> str:
        return self.robot.set_manual(on=on)

    def _put_obstacle(self, there: bool) -> str:
        return self.robot.put_obstacle(there=there)

    def _navigate(self, goal: Any) -> Task | None:
        """A goal in another frame than the map's is rejected: no transform leads there."""
        if goal.pose.header.frame_id.lstrip("/") != "map":
            return None
        return self.robot.navigate(_read_pose(goal.pose.pose))

    def _tour(self, goal: Any, *, goes_on: bool) -> Task | None:
        """Without poses, or with one in another frame, it is rejected."""
        frames = {pose.header.frame_id.lstrip("/") for pose in goal.poses}
        if frames != {"map"}:
            return None
        return self.robot.tour([_read_pose(pose.pose) for pose in goal.poses], goes_on=goes_on)

    def _dock(self, goal: Any) -> Task | None:
        return self.robot.dock(goal.dock_id, drives_there=goal.navigate_to_staging_pose)

    def _way(self, task: Task) -> Fields:
        left = self.robot.remaining
        return {
            "current_pose": {"header": _header(self._now, "map"), "pose": _pose(self.robot.pose)},
            "navigation_time": _duration(self.robot.t - task.began),
            "estimated_time_remaining": _duration(left / SPEED_M_S),
            "number_of_recoveries": task.recoveries,
            "distance_remaining": left,
        }

    def _docking(self, task: Task) -> Fields:
        return {"state": self.robot.phase, "docking_time": _duration(self.robot.t - task.began)}


def _read_pose(pose: Any) -> Pose:
    turn = pose.orientation
    yaw = math.atan2(
        2 * (turn.w * turn.z + turn.x * turn.y), 1 - 2 * (turn.y * turn.y + turn.z * turn.z)
    )
    return Pose(pose.position.x, pose.position.y, yaw)

"""The mobile robot of the story `driving` as a state machine: it drives on ways through the hall, is
blocked, docks, charges, and is driven by hand. Pure, stepped with time.

Source: the error codes of Nav2's ComputePathToPose and FollowPath, and of DockRobot (nav2_msgs).
"""

import math
from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from itertools import pairwise
from random import Random
from typing import Final, NamedTuple

from app.tools.simulator.hall import (
    RESOLUTION,
    Hall,
    Point,
    between,
    hall,
)

# Where the robot is, and where it goes.


class Pose(NamedTuple):
    """Metres and radians in the frame of the map."""

    x: float
    y: float
    yaw: float

    def then(self, child: "Pose") -> "Pose":
        """A pose that is known in this one."""
        cos, sin = math.cos(self.yaw), math.sin(self.yaw)
        return Pose(
            self.x + cos * child.x - sin * child.y,
            self.y + sin * child.x + cos * child.y,
            turned(self.yaw + child.yaw),
        )

    def inverse(self) -> "Pose":
        cos, sin = math.cos(self.yaw), math.sin(self.yaw)
        return Pose(-cos * self.x - sin * self.y, sin * self.x - cos * self.y, -self.yaw)


def turned(angle: float) -> float:
    """The same angle from -pi to pi."""
    return math.remainder(angle, 2 * math.pi)


UP, DOWN = math.pi / 2, -math.pi / 2
START: Final = Pose(5.6, -4.4, UP)
STAGING: Final = Pose(5.3, -7.2, DOWN)  # in front of the charger
DOCK: Final = Pose(5.3, -8.3, DOWN)
RADIUS: Final = 0.45
HALF_LENGTH, HALF_WIDTH = 0.55, 0.4  # of the footprint
# The places of the story, by the names that `/robot_place` has.
PLACES: Final[Mapping[str, Pose]] = {
    "PALLETIZER_1": Pose(-1.0, 9.0, math.pi),
    "PALLETIZER_2": Pose(-1.0, 3.9, math.pi),
    "WRAPPER": Pose(9.3, 17.5, UP),
    "GATE_3": Pose(17.0, 20.0, UP),
    "CHARGER": STAGING,
}
AT_PLACE_M: Final = 1.3

# How it drives.

SPEED_M_S: Final = 1.0
DOCK_M_S: Final = 0.25
ACCELERATION: Final = 0.8
TURN_RAD_S: Final = 1.2
STRAIGHT_RAD: Final = 0.5  # from this on it turns before it drives
SLICE_S: Final = 0.1
LONGEST_STEP_S: Final = 5.0  # a machine that slept goes on where it was
TELEOP_S: Final = 0.5  # it stops without a message for so long
STOPS_M: Final = 1.2  # before what is in its way
SEES_M: Final = 4.0  # how far ahead something gets in its way
PATIENCE_S: Final = 12.0  # of what is in its way
RECOVERY_S: Final = 4.0  # between two tries
BLOCKED_EACH: Final = 3  # long trips
LONG_TRIP_M: Final = 8.0
STEPS_ASIDE_S: Final = 6.0
OBSTACLE_M: Final = 0.35  # its radius
SLOW: Final = 0.5  # of its speed, before what is in its way

# The battery: of eight hours on the way, of fifteen minutes at the charger.
DRIVING_PER_S: Final = 1 / (8 * 3600)
STANDING_PER_S: Final = DRIVING_PER_S / 4
CHARGING_PER_S: Final = 1 / (15 * 60)
FIRST_CHARGE: Final = 0.64
EMPTY: Final = 0.05  # it goes no further down: a demo must not end

# Error codes of Nav2; 0 is none.
UNKNOWN_ERROR, FOLLOW_NO_PROGRESS = 9000, 105
GOAL_OUTSIDE_MAP, GOAL_OCCUPIED, NO_VALID_PATH = 204, 206, 208
DOCK_NOT_IN_DB, FAILED_TO_CONTROL = 901, 905
# nav2_msgs/action/DockRobot_Feedback
TO_STAGING, CONTROLLING, WAIT_FOR_CHARGE = 1, 3, 4
DOCK_NAME: Final = "charger"


class State(StrEnum):
    """What the robot does."""

    WAITING = "WAITING"
    DRIVING = "DRIVING"
    BLOCKED = "BLOCKED"
    DOCKING = "DOCKING"
    CHARGING = "CHARGING"
    MANUAL = "MANUAL"


class Leg(NamedTuple):
    """A part of a task: along points, then turned to `yaw` if that is not None. `speed` is in m/s."""

    points: list[Point]
    yaw: float | None = None
    speed: float | None = None  # that of the robot
    backwards: bool = False
    phase: int = 0  # of DockRobot's feedback
    stop: int = 0  # the number of the pose of a tour to which it leads


@dataclass(slots=True)
class Task:
    """What a goal asks for. `code` and `message` are its error; it ran from `began` on."""

    began: float
    legs: deque[Leg]
    docks: bool = False
    code: int = 0
    message: str = ""
    has_ended: bool = False
    recoveries: int = 0
    wait_s: float = 0.0  # at its end
    stops: int = 0  # poses of a tour
    goes_on: bool = False  # to the next pose where the way to one is blocked
    missed: dict[int, int] = field(default_factory=dict)  # the poses that it gave up, with their codes
    length: float = field(init=False)

    def __post_init__(self) -> None:
        self.length = sum(length_of(leg.points) for leg in self.legs)

    @property
    def stop(self) -> int:
        """The number of the pose of a tour to which it drives, from 0 on."""
        return self.legs[0].stop if self.legs else self.stops

    def fail(self, code: int, message: str) -> None:
        self.code, self.message, self.has_ended = code, message, True


def length_of(points: list[Point]) -> float:
    return sum(math.dist(a, b) for a, b in pairwise(points))


@dataclass(slots=True)
class Obstacle:
    """Something in the way, until `until`; infinite while a visitor leaves it there."""

    at: Point
    until: float


# nav2_msgs/msg/CollisionMonitorState
COLLISION_NONE, COLLISION_STOP, COLLISION_SLOW = 0, 1, 2

LOG_INFO, LOG_WARN, LOG_ERROR = 20, 30, 40  # rcl_interfaces/msg/Log


# The robot as a state machine: pure, stepped with time. A command returns "" if it is done, else why
# the robot refuses it, in words.

DRIVES: Final = "The robot drives. Press Stop, or wait."
STANDS_AT_CHARGER: Final = "The robot stands at the charger. Undock it."


class MobileRobot:
    """The robot. `notes` has what it says since the last call, as (level, text) of a ROS log."""

    def __init__(self, seed: int = 0) -> None:
        self._random = Random(seed)
        self.hall: Hall = hall()
        self.t = 0.0
        self.pose = START
        self.speed_m_s = SPEED_M_S  # on free ways
        self.limit = 100.0  # percent of that
        self.speed = self.turning = 0.0  # m/s, rad/s
        self.driven = 0.0  # metres
        self.charge = FIRST_CHARGE
        self.is_docked = self.is_manual = False
        self.task: Task | None = None
        self.obstacle: Obstacle | None = None
        self.uncertainty = 0.04  # metres, one standard deviation
        self._waits_for_obstacle = False  # a visitor's, until the robot drives
        self._trips = 0
        self._blocks_at: float | None = None  # metres that remain then
        self._gone = 0.0  # metres of the leg
        self._blocked_since: float | None = None
        self._recovered_at = 0.0
        self._teleop, self._teleop_until = (0.0, 0.0), -math.inf
        self._notes: list[tuple[int, str]] = [(LOG_INFO, "ready")]

    # What it is.

    @property
    def state(self) -> State:
        if self.is_manual:
            return State.MANUAL
        if self._blocked_since is not None:
            return State.BLOCKED
        if self.task is not None:
            return State.DOCKING if self.task.docks and self.phase != TO_STAGING else State.DRIVING
        return State.CHARGING if self.is_docked else State.WAITING

    @property
    def is_blocked(self) -> bool:
        return self._blocked_since is not None

    @property
    def collision(self) -> int:
        """What the collision monitor does."""
        if self.is_blocked:
            return COLLISION_STOP
        if self.task is None or self.obstacle is None:
            return COLLISION_NONE
        is_near = math.dist(self.obstacle.at, self.pose[:2]) <= SEES_M + OBSTACLE_M
        return COLLISION_SLOW if is_near else COLLISION_NONE

    def limit_speed(self, value: float, *, is_percentage: bool) -> None:
        """A speed limit, in percent of its greatest speed or in m/s; 0 is none."""
        percent = value if is_percentage else 100 * value / self.speed_m_s
        self.limit = percent if 0 < percent < 100 else 100.0

    @property
    def moves(self) -> bool:
        return abs(self.speed) > 1e-3 or abs(self.turning) > 1e-3

    @property
    def phase(self) -> int:
        if self.task is None:
            return 0
        return self.task.legs[0].phase if self.task.legs else WAIT_FOR_CHARGE

    @property
    def place(self) -> str:
        """The name of the place where it is; "" on the way."""
        if self.is_docked:
            return "CHARGER"
        near = (name for name, at in PLACES.items() if math.dist(at[:2], self.pose[:2]) <= AT_PLACE_M)
        return next(near, "")

    @property
    def remaining(self) -> float:
        """Metres to the end of its task."""
        if self.task is None or not self.task.legs:
            return 0.0
        return max(0.0, sum(length_of(leg.points) for leg in self.task.legs) - self._gone)

    @property
    def route(self) -> list[Point]:
        """The points that are ahead; none without a task."""
        if self.task is None or not self.task.legs:
            return []
        leg = self.task.legs[0]
        ahead = [point for gone, point in _with_lengths(leg.points) if gone > self._gone]
        return [self.pose[:2], *ahead]

    @property
    def odom(self) -> Pose:
        """Where its odometry begins, in the map: it drifts with the way."""
        way = self.driven
        drift = (0.06 * math.sin(way / 17), 0.05 * math.sin(way / 11), 0.01 * math.sin(way / 23))
        return Pose(START.x + drift[0], START.y + drift[1], drift[2])

    @property
    def by_odometry(self) -> Pose:
        """Where it is in the frame `odom`."""
        return self.odom.inverse().then(self.pose)

    @property
    def hours_left(self) -> float:
        return (self.charge - EMPTY) / DRIVING_PER_S / 3600

    @property
    def has_visitors_obstacle(self) -> bool:
        """Whether a visitor has put something in its way."""
        return self._waits_for_obstacle

    def notes(self) -> list[tuple[int, str]]:
        notes, self._notes = self._notes, []
        return notes

    # Commands.

    def navigate(self, goal: Pose) -> Task | None:
        """Drives to a pose, in place of another such task; None if it takes no goal now. A pose that
        can't be reached ends the task with Nav2's code."""
        if self.is_manual or (self.task is not None and self.task.docks):
            return None
        self._end_task(UNKNOWN_ERROR, "another goal came")
        legs = deque([self._undocking()]) if self.is_docked else deque[Leg]()
        start = STAGING[:2] if self.is_docked else self.pose[:2]
        task = self.task = Task(self.t, legs)
        if refused := self._refused_goal(goal):
            task.fail(*refused)
        elif way := self.hall.way(start, goal[:2], RADIUS):
            task.legs.append(Leg(way, goal.yaw))
            task.length += length_of(way)
            self._begin_trip(task)
        else:
            task.fail(NO_VALID_PATH, "no way leads there")
        self._close_ended()
        return task

    def tour(self, goals: list[Pose], *, goes_on: bool) -> Task | None:
        """Drives to poses one after the other, in place of another such task; None if it takes no goal
        now. With `goes_on` a pose that it does not reach is missed, and the next one follows."""
        if self.is_manual or (self.task is not None and self.task.docks):
            return None
        self._end_task(UNKNOWN_ERROR, "another goal came")
        task = self.task = Task(self.t, deque([self._undocking()] if self.is_docked else []))
        task.stops, task.goes_on = len(goals), goes_on
        start = STAGING[:2] if self.is_docked else self.pose[:2]
        for stop, goal in enumerate(goals):
            refused = self._refused_goal(goal)
            way = [] if refused else self.hall.way(start, goal[:2], RADIUS)
            if way:
                task.legs.append(Leg(way, goal.yaw, stop=stop))
                start = goal[:2]
                continue
            code, message = refused or (NO_VALID_PATH, "no way leads there")
            task.missed[stop] = code
            if not goes_on:
                task.fail(code, message)
                break
        task.length = sum(length_of(leg.points) for leg in task.legs)
        if len(task.missed) == len(goals) and not task.has_ended:
            task.fail(NO_VALID_PATH, "no way leads there")
        if not task.has_ended:
            self._begin_trip(task)
        self._close_ended()
        return task

    def dock(self, name: str, *, drives_there: bool) -> Task | None:
        """Drives to the charger and docks; None if it takes no goal now."""
        if self.is_manual or self.task is not None or self.is_docked:
            return None
        task = self.task = Task(self.t, deque(), docks=True, wait_s=1.5)
        if name not in ("", DOCK_NAME):
            task.fail(DOCK_NOT_IN_DB, f"no dock is named {name}")
        elif drives_there:
            way = self.hall.way(self.pose[:2], STAGING[:2], RADIUS)
            task.legs.append(Leg(way, DOCK.yaw, phase=TO_STAGING))
        elif math.dist(self.pose[:2], STAGING[:2]) > AT_PLACE_M:
            task.fail(FAILED_TO_CONTROL, "the dock is too far away")
        if not task.has_ended:
            way = [STAGING[:2] if task.legs else self.pose[:2], DOCK[:2]]
            task.legs.append(Leg(way, DOCK.yaw, DOCK_M_S, phase=CONTROLLING))
            task.length = self.remaining
            self._begin_trip(task)
        self._close_ended()
        return task

    def undock(self) -> Task | None:
        """Drives back from the charger; None if it is not there."""
        if not self.is_docked or self.is_manual:
            return None
        task = self.task = Task(self.t, deque([self._undocking()]), docks=True)
        self.is_docked = False
        self._gone = 0.0
        return task

    def stop(self) -> str:
        """Ends the task; the robot stands."""
        self._end_task(UNKNOWN_ERROR, "stopped")
        self._teleop_until = -math.inf
        self.speed = self.turning = 0.0
        return ""

    def cancel(self) -> None:
        """The task ends without an error."""
        self.task, self._blocked_since = None, None

    def set_manual(self, *, on: bool) -> str:
        if on and self.task is not None:
            return DRIVES
        if on and self.is_docked:
            return STANDS_AT_CHARGER
        self.is_manual = on
        return ""

    def teleop(self, speed: float, turning: float) -> None:
        """Moves it by hand until `TELEOP_S` after the last call."""
        if self.is_manual:
            self._teleop, self._teleop_until = (speed, turning), self.t + TELEOP_S

    def set_pose(self, pose: Pose) -> None:
        """Its position is set: the robot of a demo knows it, and is less sure for a while."""
        self.uncertainty = 0.5

    def put_obstacle(self, *, there: bool) -> str:
        """A visitor puts something in its way, or takes it away."""
        self._waits_for_obstacle = there
        if not there:
            self.obstacle = None
        return ""

    # Time.

    def step(self, t: float) -> None:
        """Goes on to `t`, in seconds since the start."""
        self.t = max(self.t, t - LONGEST_STEP_S)
        while self.t < t - 1e-9:
            self._advance(min(SLICE_S, t - self.t))

    def _advance(self, dt: float) -> None:
        self.t += dt
        if self.obstacle is not None and self.t >= self.obstacle.until:
            self.obstacle = None
        before = self.pose
        if self.is_manual:
            self._move_by_hand(dt)
        elif self.task is not None:
            self._drive(self.task, dt)
        else:
            self.speed = self.turning = 0.0
        way = math.dist(before[:2], self.pose[:2])
        self.driven += way
        self.uncertainty += (0.04 + 0.02 * math.sin(self.driven / 9) - self.uncertainty) * dt / 4
        self._use_battery(dt)

    def _use_battery(self, dt: float) -> None:
        if self.is_docked and self.task is None:
            self.charge = min(1.0, self.charge + CHARGING_PER_S * dt)
        else:
            used = DRIVING_PER_S if self.moves else STANDING_PER_S
            self.charge = max(EMPTY, self.charge - used * dt)

    def _move_by_hand(self, dt: float) -> None:
        wanted = self._teleop if self.t < self._teleop_until else (0.0, 0.0)
        self.speed, self.turning = wanted
        to = self.pose.then(Pose(self.speed * dt, 0.0, self.turning * dt))
        ahead = self.hall.clearance(to.x, to.y)
        if ahead < RADIUS and ahead < self.hall.clearance(*self.pose[:2]):
            self.speed = 0.0  # it turns, and drives away from the wall
            to = self.pose._replace(yaw=to.yaw)
        self.pose = to

    def _drive(self, task: Task, dt: float) -> None:
        if self.is_docked:
            self.is_docked = False
        if not task.legs:
            self._wait_at_end(task, dt)
            return
        leg = task.legs[0]
        self._meet_obstacle(leg)
        if self._is_stopped(task):
            self.speed = self.turning = 0.0
            return
        length = length_of(leg.points)
        target, heading = _ahead(leg.points, self._gone)
        if leg.backwards:
            heading = turned(heading + math.pi)
        if self._gone >= length:
            if leg.yaw is None or self._turn_to(leg.yaw, dt):
                self._end_leg(task)
            return
        straight = self._turn_to(heading, dt, STRAIGHT_RAD)
        rest = math.sqrt(2 * ACCELERATION * max(length - self._gone, 0.005))
        most = min(leg.speed or self.speed_m_s, self.speed_m_s * self.limit / 100)
        most *= SLOW if self.collision == COLLISION_SLOW else 1.0
        wanted = min(most, rest) if straight else 0.0
        change = ACCELERATION * dt
        now = abs(self.speed)
        now = min(wanted, now + change) if wanted > now else max(wanted, now - 3 * change)
        self._gone = min(length, self._gone + max(now * dt, 0.001 if straight else 0.0))
        target, _ = _ahead(leg.points, self._gone)
        self.speed = -now if leg.backwards else now
        self.pose = Pose(target[0], target[1], self.pose.yaw)

    def _turn_to(self, yaw: float, dt: float, tolerance: float = 1e-3) -> bool:
        """Turns towards a heading; whether it is within the tolerance."""
        error = turned(yaw - self.pose.yaw)
        step = max(-TURN_RAD_S * dt, min(error, TURN_RAD_S * dt))
        self.turning = step / dt
        self.pose = self.pose._replace(yaw=turned(self.pose.yaw + step))
        return abs(error - step) <= tolerance

    def _end_leg(self, task: Task) -> None:
        task.legs.popleft()
        self._gone = self.speed = self.turning = 0.0
        if not task.legs and task.wait_s <= 0:
            self._succeed(task)

    def _wait_at_end(self, task: Task, dt: float) -> None:
        task.wait_s -= dt
        if task.wait_s <= 0:
            self._succeed(task)

    def _succeed(self, task: Task) -> None:
        self.is_docked = task.docks and math.dist(self.pose[:2], DOCK[:2]) < 0.1
        task.has_ended = True
        self._note("docked" if self.is_docked else "goal reached")
        self._close_ended()

    def _meet_obstacle(self, leg: Leg) -> None:
        """Something gets in the way: a visitor's thing, or someone on each third long trip."""
        if leg.backwards or leg.phase == CONTROLLING or self.obstacle is not None:
            return
        ahead = length_of(leg.points) - self._gone
        if self._waits_for_obstacle and ahead > STOPS_M:
            until = math.inf
        elif self._blocks_at is not None and self.remaining <= self._blocks_at and ahead > SEES_M:
            self._blocks_at, until = None, self.t + STEPS_ASIDE_S + self._random.uniform(0, 4)
        else:
            return
        at, _ = _ahead(leg.points, min(self._gone + SEES_M, self._gone + ahead))
        self.obstacle = Obstacle(at, until)

    def _is_stopped(self, task: Task) -> bool:
        """Whether something stands in its way; after a time the task fails."""
        near = (
            self.obstacle is not None
            and math.dist(self.obstacle.at, self.pose[:2]) <= STOPS_M + OBSTACLE_M
        )
        if not near:
            if self._blocked_since is not None:
                self._note("way is free again")
            self._blocked_since = None
            return False
        if self._blocked_since is None:
            self._blocked_since = self._recovered_at = self.t
            self._note("way is blocked", LOG_WARN)
        if self.t - self._recovered_at >= RECOVERY_S:
            self._recovered_at = self.t
            task.recoveries += 1
        if self.t - self._blocked_since >= PATIENCE_S:
            if task.goes_on and task.stop + 1 < task.stops:
                self._miss(task)
            else:
                task.missed[task.stop] = FOLLOW_NO_PROGRESS
                self._end_task(FOLLOW_NO_PROGRESS, "failed to make progress: the way is blocked")
        return True

    def _miss(self, task: Task) -> None:
        """Gives up a pose of a tour, and drives to the next one from where it stands."""
        given_up = task.legs.popleft()
        task.missed[given_up.stop] = FOLLOW_NO_PROGRESS
        self._note(f"waypoint {given_up.stop + 1} missed ({FOLLOW_NO_PROGRESS})", LOG_WARN)
        following = task.legs.popleft()
        end = following.points[-1]
        way = self.hall.way(self.pose[:2], end, RADIUS) or [self.pose[:2], end]
        task.legs.appendleft(following._replace(points=way))
        self._gone, self._blocked_since = 0.0, None

    def _begin_trip(self, task: Task) -> None:
        self._gone = 0.0
        if task.length < LONG_TRIP_M:
            return
        self._trips += 1
        blocked = self._trips % BLOCKED_EACH == 0
        self._blocks_at = 0.6 * task.length if blocked else None

    def _undocking(self) -> Leg:
        return Leg([DOCK[:2], STAGING[:2]], speed=DOCK_M_S, backwards=True, phase=CONTROLLING)

    def _refused_goal(self, goal: Pose) -> tuple[int, str] | None:
        """Nav2's code and message for a pose that its planner refuses."""
        if not self.hall.contains(goal.x, goal.y):
            return GOAL_OUTSIDE_MAP, "the goal is outside the map"
        if self.hall.clearance(goal.x, goal.y) < RADIUS - RESOLUTION:
            return GOAL_OCCUPIED, "the goal is occupied"
        return None

    def _end_task(self, code: int, message: str) -> None:
        if self.task is not None:
            self.task.fail(code, message)
            self._close_ended()

    def _close_ended(self) -> None:
        if self.task is not None and self.task.has_ended:
            if self.task.code:
                self._note(f"{self.task.message} ({self.task.code})", LOG_ERROR)
            self.task, self._blocked_since = None, None
            self.speed = self.turning = 0.0

    def _note(self, text: str, level: int = LOG_INFO) -> None:
        self._notes.append((level, text))


def _with_lengths(points: list[Point]) -> Iterator[tuple[float, Point]]:
    """Each point with its way from the first one."""
    gone = 0.0
    for number, point in enumerate(points):
        gone += math.dist(points[number - 1], point) if number else 0.0
        yield gone, point


def _ahead(points: list[Point], gone: float) -> tuple[Point, float]:
    """The point after `gone` metres of a line, and the direction of the line there."""
    left, heading = gone, 0.0
    for start, end in pairwise(points):
        length = math.dist(start, end)
        heading = math.atan2(end[1] - start[1], end[0] - start[0])
        if left < length:
            return between(start, end, left / length), heading
        left -= length
    return points[-1], heading

"""The palletizing cell as a part of a simulated robot: its messages, commands and the action by which a
full pallet goes out. Pure."""

from collections.abc import Callable, Iterator, Mapping
from typing import Any, Final

from app.panel.stories import PALLETIZING, Story
from app.simulator.goals import EVERY_GOAL
from app.simulator.palletizing.cell import OUT_S, PalletizingCell
from app.simulator.palletizing.messages import ROWS, Fields, log_fields
from app.simulator.robot import (
    CANCEL_OK,
    CANCEL_TOO_LATE,
    CANCEL_UNKNOWN,
    CANCELED,
    EXECUTING,
    KEPT_GOALS,
    SUCCEEDED,
)
from app.simulator.values.known_types import Moment

ABORTED: Final = 6  # action_msgs/msg/GoalStatus
REPEAT_S: Final = 1.0
EARLY_S: Final = 0.02  # a step may come a little too early
LOG: Final = "/rosout"
OUT: Final = "/pallet_out"


class PalletOut:
    """The action `/pallet_out`: one goal at a time. Its feedback and its result are the percentage that
    is done, as the only number of a sequence: ROS 2 itself has no action with a progress."""

    type = PALLETIZING.actions[OUT]

    def __init__(self, cell: PalletizingCell) -> None:
        self._cell = cell
        self._goals: dict[bytes, int] = {}
        self._running: bytes | None = None
        self._pallet = 0
        self._reported = -1

    def step(self) -> None:
        """Ends the running goal when its pallet is out, or stays."""
        if self._running is not None and self._cell.out_s is None:
            out = self._cell.pallet > self._pallet
            self._goals[self._running] = SUCCEEDED if out else ABORTED
            self._running = None

    def begin(self, goal_id: bytes, goal: Any) -> bool:
        if goal_id in self._goals or self._cell.move_pallet_out():
            return False
        self._goals[goal_id], self._running = EXECUTING, goal_id
        self._pallet, self._reported = self._cell.pallet, -1
        for old in list(self._goals)[:-KEPT_GOALS]:
            del self._goals[old]
        return True

    def cancel(self, goal_id: bytes) -> tuple[int, list[bytes]]:
        if goal_id != EVERY_GOAL and goal_id not in self._goals:
            return CANCEL_UNKNOWN, []
        if self._running is None or goal_id not in (EVERY_GOAL, self._running):
            return CANCEL_OK if goal_id == EVERY_GOAL else CANCEL_TOO_LATE, []
        canceled, self._running = self._running, None
        self._cell.keep_pallet()
        self._goals[canceled] = CANCELED
        return CANCEL_OK, [canceled]

    def feedback(self) -> list[tuple[bytes, Fields]]:
        percent = self._percent()
        if self._running is None or percent == self._reported:
            return []
        self._reported = percent
        return [(self._running, {"sequence": [percent]})]

    def states(self) -> list[tuple[bytes, int]]:
        return list(self._goals.items())

    def result(self, goal_id: bytes) -> tuple[int, Fields] | None:
        status = self._goals.get(goal_id, 0)
        done = [100] if status == SUCCEEDED else []
        return None if status == EXECUTING else (status, {"sequence": done})

    def _percent(self) -> int:
        return round(100 * (self._cell.out_s or 0.0) / OUT_S)


class PlayedPalletizing:
    """The story, for the `names` that the panel uses."""

    def __init__(self, names: Story, seed: int) -> None:
        self.names = names
        self.cell = PalletizingCell(seed)
        self._out = PalletOut(self.cell)
        self.actions = {name: self._out for name in names.actions}
        self._published: dict[str, tuple[float, Any]] = {}
        self._services: Mapping[str, Callable[[Any], str]] = {
            "/cell/start": lambda _: self.cell.start(),
            "/cell/pause": lambda _: self.cell.pause(),
            "/reset": lambda _: self.cell.reset(),
            "/light": self._switch_light,
            "/cell/guard_door": self._move_door,
        }

    def is_latched(self, topic: str) -> bool:
        """Whether late subscribers get the last message."""
        return topic in ROWS and ROWS[topic].latched

    def receive(self, topic: str, message: Any) -> None:
        match topic:
            case "/cell/stop":
                self.cell.stop()
            case "/cell/belt_jog":
                self.cell.jog(message.data)
            case "/cell/recipe":
                self.cell.load_order(message.data.rpartition(" ")[2])

    def serve(self, service: str, request: Any) -> Fields:
        """The response, with a message if it is refused. A panel has words for success."""
        refused = self._services[service](request)
        return {"success": not refused, "message": refused}

    def step(self, moment: Moment) -> Iterator[tuple[str, Fields]]:
        """The messages that it publishes, as (topic, fields)."""
        self.cell.step(moment.t)
        self._out.step()
        for level, text in self.cell.notes():
            if LOG in self.names.publishes:
                yield LOG, log_fields(level, text, moment)
        for topic in self.names.publishes:
            if topic in ROWS and (fields := self._due(topic, moment)) is not None:
                yield topic, fields

    def _due(self, topic: str, moment: Moment) -> Fields | None:
        row, last = ROWS[topic], self._published.get(topic)
        value = row.value(self.cell)
        if last is not None:
            since = moment.t - last[0] + EARLY_S
            if since < (REPEAT_S if value == last[1] else row.least_s):
                return None
        self._published[topic] = moment.t, value
        return row.fields(value, moment)

    def _switch_light(self, request: Any) -> str:
        self.cell.switch_light(on=request.data)
        return ""

    def _move_door(self, request: Any) -> str:
        self.cell.door.move(opened=request.data)
        return ""

"""What one robot's kiosk takes and what is pressed, recorded around each press. On the event loop."""

import asyncio
import time
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any, Final

from app.commands.receipts import Receipt
from app.i18n import render
from app.interfaces import Interfaces
from app.panel.model import Panel
from app.panel.rules import RecordRules
from app.recording.directory import name_of
from app.recording.mcap_file import Channel
from app.recording.ring_buffer import RingBuffer, buffered
from app.recording.writer import Recording, Recordings
from app.robot.state import RobotState, Sample

AGAIN_S: Final = 1.0
LONGEST_S: Final = 600.0  # after a press, a recording waits for its receipt no longer


class Recorder:
    """Keeps a ring, and has a recording open from a press until `after_s` after the last one."""

    def __init__(
        self,
        panel: Panel,
        rules: RecordRules,
        interfaces: Interfaces,
        robot: RobotState,
        robot_id: str,
        recordings: Recordings,
    ) -> None:
        """`robot_id` is "" where there is only one."""
        self._recordings = recordings
        self._rules = rules
        self._robot_id = robot_id
        self._about = {"panel": panel.title, "robot": robot.name, "before_s": f"{rules.before_s:g}",
                       "after_s": f"{rules.after_s:g}"}  # fmt: skip
        types = panel.subscriptions()
        self._channels = {
            robot.key(topic): Channel(
                f"/{robot.key(topic)}", types[topic], interfaces.definition(types[topic])
            )
            for topic in (types if rules.topics is None else rules.topics)
        }
        self._ring = RingBuffer(rules.before_s, recordings.ring_bytes)
        self._open: Recording | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._under_way: dict[str, str] = {}  # press → who
        self._last = 0.0  # monotonic seconds, of a press or a receipt

    @property
    def keys(self) -> frozenset[str]:
        """The keys of the topics that are recorded."""
        return frozenset(self._channels)

    def hear(self, key: str, sample: Sample) -> None:
        """A sample that the kiosk took."""
        if key in self._channels:
            one = buffered(key, sample)
            self._ring.add(one)
            if self._open is not None:
                self._open.add(one)

    def pressed(self, press_id: str, widget: str, who: str, inputs: Mapping[str, Any]) -> None:
        """A press, before it is judged."""
        if self._open is None or self._open.full:
            self._begin(widget)
        self._under_way[press_id] = who
        at = datetime.now(UTC).isoformat(timespec="milliseconds")
        self._tell(id=press_id, widget=widget, who=who, values=dict(inputs), outcome=None,
                   reason=None, at=at)  # fmt: skip

    def answered(self, receipt: Receipt) -> None:
        """What came of a press, or what is known of it by now."""
        who = self._under_way.pop(receipt.id, "")
        self._tell(id=receipt.id, widget=receipt.widget, who=who, values=dict(receipt.inputs),
                   outcome=receipt.outcome, reason=render(receipt.reason), at=receipt.at)  # fmt: skip

    def stop(self) -> None:
        """Ends the recording that is open."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        self._under_way.clear()
        self._close()

    def _close(self) -> None:
        if self._open is not None:
            self._open.end()
            self._open = None

    def _begin(self, widget: str) -> None:
        self._close()
        name = name_of(time.time(), self._robot_id, widget)
        self._open = self._recordings.begin(name, self._channels, self._about)
        for one in self._ring.since(time.monotonic()):
            self._open.add(one)

    def _tell(self, **press: Any) -> None:
        if self._open is None:
            return  # a correction of what was pressed long ago
        self._open.add_press(press, time.time_ns())
        self._last = time.monotonic()
        self._end_in(self._rules.after_s)

    def _end_in(self, seconds: float) -> None:
        if self._timer is not None:
            self._timer.cancel()
        self._timer = asyncio.get_running_loop().call_later(seconds, self._end)

    def _end(self) -> None:
        if self._under_way and time.monotonic() - self._last < LONGEST_S:
            self._end_in(AGAIN_S)
        else:
            self.stop()

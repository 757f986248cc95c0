"""Records one robot's samples and presses around each press. Used on the event loop only."""

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
from app.recording.bounded_folder import recording_name
from app.recording.mcap_file import Channel, packed
from app.recording.ring_buffer import RingBuffer, times_of, to_buffered
from app.recording.writer import Recording, Recordings
from app.robot.state import RobotState, Sample

RECHECK_S: Final = 1.0
LAST_S: Final = 60.0  # of the download of the last minute
MAX_WAIT_S: Final = 600.0  # how long a recording waits for the receipt of a press


class Recorder:
    """Keeps the ring buffer, and a recording from a press until `after_s` after the last one."""

    def __init__(
        self,
        panel: Panel,
        rules: RecordRules,
        interfaces: Interfaces,
        robot: RobotState,
        robot_id: str,
        recordings: Recordings,
    ) -> None:
        """`robot_id` is "" if the panel has only one robot."""
        self._recordings = recordings
        self._rules = rules
        self._robot_id = robot_id
        self._metadata = {
            "panel": str(panel.title),
            "robot": robot.name,
            "before_s": f"{rules.before_s:g}",
            "after_s": f"{rules.after_s:g}",
        }
        types = panel.subscriptions()
        self._channels = {
            key: Channel(f"/{key}", types[topic], interfaces.definition(types[topic]))
            for topic in (types if rules.topics is None else rules.topics)
            for key in robot.possible_keys(topic)
        }
        self._ring = RingBuffer(max(rules.before_s, LAST_S), recordings.ring_bytes)
        self._packing = asyncio.Lock()  # one at a time: each holds its samples
        self._recording: Recording | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._pending_presses: dict[str, str] = {}  # press → who
        self._last_event_at = 0.0  # monotonic seconds, of a press or a receipt

    @property
    def keys(self) -> frozenset[str]:
        """The keys of the recorded topics."""
        return frozenset(self._channels)

    def record_sample(self, key: str, sample: Sample) -> None:
        """A sample was received."""
        if key in self._channels:
            buffered = to_buffered(key, sample)
            self._ring.add(buffered)
            if self._recording is not None:
                self._recording.add(buffered)

    def record_press(self, press_id: str, widget: str, who: str, inputs: Mapping[str, Any]) -> None:
        """A press was made; it is not checked yet."""
        if self._recording is None or self._recording.is_full:
            self._begin_recording(widget)
        self._pending_presses[press_id] = who
        at = datetime.now(UTC).isoformat(timespec="milliseconds")
        self._write_press(id=press_id, widget=widget, who=who, values=dict(inputs), outcome=None,
                   reason=None, at=at)  # fmt: skip

    def record_receipt(self, receipt: Receipt) -> None:
        """A press got its receipt, or a correction of it."""
        who = self._pending_presses.pop(receipt.id, "")
        self._write_press(id=receipt.id, widget=receipt.widget, who=who, values=dict(receipt.inputs),
                   outcome=receipt.outcome, reason=render(receipt.reason), at=receipt.at)  # fmt: skip

    async def last_minute(self) -> bytes:
        """What was received in the last `LAST_S` seconds, as an MCAP file; less where it is more than
        the ring takes."""
        async with self._packing:
            recent = self._ring.recent(time.monotonic(), LAST_S)
            samples = [(buffered.key, buffered.sample) for buffered in recent]
            messages = (
                (self._channels[key], bytes(sample.payload), *times_of(sample))
                for key, sample in samples
            )
            return await asyncio.to_thread(packed, messages, self._metadata)

    def stop(self) -> None:
        """Ends the current recording."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        self._pending_presses.clear()
        self._close()

    def _close(self) -> None:
        if self._recording is not None:
            self._recording.finish()
            self._recording = None

    def _begin_recording(self, widget: str) -> None:
        self._close()
        name = recording_name(time.time(), self._robot_id, widget)
        self._recording = self._recordings.begin(name, self._channels, self._metadata)
        for buffered in self._ring.recent(time.monotonic(), self._rules.before_s):
            self._recording.add(buffered)

    def _write_press(self, **press: Any) -> None:
        if self._recording is None:
            return  # a late correction
        self._recording.add_press(press, time.time_ns())
        self._last_event_at = time.monotonic()
        self._stop_after(self._rules.after_s)

    def _stop_after(self, seconds: float) -> None:
        if self._timer is not None:
            self._timer.cancel()
        self._timer = asyncio.get_running_loop().call_later(seconds, self._stop_if_idle)

    def _stop_if_idle(self) -> None:
        if self._pending_presses and time.monotonic() - self._last_event_at < MAX_WAIT_S:
            self._stop_after(RECHECK_S)
        else:
            self.stop()

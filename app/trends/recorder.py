"""Records the fields that trends show, and those that alarms have limits for, from each sample. Used on
the event loop only.

Samples are kept undecoded for a moment, and decoded in slices of some milliseconds: whatever a robot
publishes delays no press and no hold by more than a slice.
"""

import asyncio
import logging
import math
import time
from itertools import islice
from typing import Any, Final, NamedTuple

from app.bounded import BoundedQueue
from app.errors import DecodeError
from app.interfaces import FieldReader, Interfaces, has_key
from app.panel.model import Panel
from app.panel.widgets.trend import RAW_S, kept_fields, trends_of
from app.robot.history import FieldHistory
from app.robot.sample import Sample
from app.robot.slices import Slices
from app.robot.state import RobotState

log = logging.getLogger("kiosk.trends")

DECODE_AFTER_S: Final = 0.2
MAX_PENDING: Final = 4_000  # samples that are not decoded yet
MAX_PENDING_BYTES: Final = 16_000_000
FORGET_EVERY: Final = 300  # decoded batches
MAX_ALARMED: Final = 50  # fields that only alarms need: the others have no curve
BETWEEN_CLOCK: Final = 32  # samples that are decoded between two looks at the clock


class Pending(NamedTuple):
    """A sample that is not decoded yet; `whole` is false where the one before is not continued."""

    key: str
    at: float
    wall: float
    data: bytes
    whole: bool


class TrendRecorder:
    """The `SampleListener` of a robot's history."""

    def __init__(
        self, panel: Panel, interfaces: Interfaces, robot: RobotState, slices: Slices | None = None
    ) -> None:
        self._robot = robot
        self._slices = slices or robot.slices
        self._readers: dict[str, FieldReader] = {}
        self._fields: dict[str, list[tuple[str, FieldHistory]]] = {}
        self._origins: dict[tuple[str, str | None], int] = {}  # (topic's key, bridge) → cuts
        self._pending: BoundedQueue[Pending] = BoundedQueue(MAX_PENDING, MAX_PENDING_BYTES)
        self._timer: asyncio.TimerHandle | None = None
        self._batches = 0
        types = panel.subscriptions()
        by_topic: dict[str, list[str]] = {}
        for (topic, field), (keep_s, max_age_s) in recorded_fields(panel).items():
            by_topic.setdefault(topic, []).append(field)
            history = FieldHistory(keep_s, max_age_s)
            robot.history.fields[robot.key(topic), field] = history
            self._fields.setdefault(robot.key(topic), []).append((field, history))
        for topic, fields in by_topic.items():
            self._readers[robot.key(topic)] = interfaces.field_reader(types[topic], fields)

    @property
    def keys(self) -> frozenset[str]:
        return frozenset(self._readers)

    def record_sample(self, key: str, sample: Sample) -> None:
        """A sample was received: it is decoded within a moment."""
        cuts = self._robot.cuts(key)
        whole = self._origins.get((key, sample.source)) == cuts
        if not whole:
            current = [(o, n) for o, n in self._origins.items() if o[0] != key or n == cuts]
            self._origins = dict(current)
            self._origins[key, sample.source] = cuts
        pending = Pending(key, sample.at, sample.wall, bytes(sample.payload), whole)
        for lost in self._pending.add(pending, len(pending.data)):
            self._interrupt(lost.key)
        if self._timer is None:
            loop = asyncio.get_running_loop()
            self._timer = loop.call_later(DECODE_AFTER_S, self._begin)

    def stop(self) -> None:
        """Decodes what is pending."""
        if self._timer is not None:
            self._timer.cancel()
        self.decode(math.inf)

    def decode(self, until: float) -> bool:
        """Decodes until a time (monotonic seconds); returns whether nothing is left."""
        while self._pending:
            for _ in range(min(BETWEEN_CLOCK, len(self._pending))):
                self._record(self._pending.take())
                if self._pending and len(self._pending[0].data) > 2_000:
                    break
            if time.monotonic() >= until:
                break
        if self._pending:
            return False
        self._timer = None
        self._batches += 1
        if self._batches % FORGET_EVERY == 0:
            now = self._robot.history.time(time.monotonic())
            for history in self._robot.history.fields.values():
                history.forget_old(now)
        return True

    def _begin(self) -> None:
        self._slices.schedule(self.decode)

    def _interrupt(self, key: str) -> None:
        for _, history in self._fields[key]:
            history.interrupt()

    def _record(self, pending: Pending) -> None:
        if not pending.whole:
            self._interrupt(pending.key)
        try:
            values = self._readers[pending.key].read(pending.data, pending.wall)
        except DecodeError:  # the topic's state counts and logs it
            self._interrupt(pending.key)
            return
        except Exception:  # the next sample has another try
            log.exception("a sample of %s is missing in the trends", pending.key)
            self._interrupt(pending.key)
            return
        at = self._robot.history.time(pending.at)
        for field, history in self._fields[pending.key]:
            value = values.get(field)
            if value is None and has_key(field) and not values.is_ambiguous(field):
                continue  # another node's part of the list
            history.add(at, _number(value))


def recorded_fields(panel: Panel) -> dict[tuple[str, str], tuple[float, float]]:
    """(topic, field) → how long it is kept, and after which silence there is a gap, in seconds: of all
    trends, and of the first alarms with limits."""
    kept = kept_fields(trends_of(panel))
    fields = {value: (trend.keep_s, trend.max_age_s) for value, trend in kept.items()}
    limited = ((alarm.limited_value, alarm.max_age_s or math.inf) for alarm in panel.alarms)
    added = {value: (RAW_S, max_age_s) for value, max_age_s in limited if value and value not in fields}
    return fields | dict(islice(added.items(), MAX_ALARMED))


def _number(value: Any) -> float:
    """NaN for an element that is not there, or a number beyond all floats."""
    try:
        return math.nan if value is None else float(value)
    except OverflowError:
        return math.nan

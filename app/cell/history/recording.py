"""Recordings around presses and stops, as MCAP files in a folder of limited size."""

import asyncio
import fcntl
import json
import logging
import math
import os
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from io import BytesIO
from pathlib import Path
from typing import IO, Any, Final

from mcap.records import Channel as ChannelRecord
from mcap.records import McapRecord, Message, Metadata, Schema
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer

from app.cell.commands.receipts import Receipt
from app.cell.robot.state import RobotState, Sample
from app.panel.model import Panel
from app.panel.rules import RecordRules
from app.ros.messages import Interfaces
from app.system.disk_writer import DiskWriter
from app.system.errors import LogError, os_error_text
from app.system.limits import Quota, TokenBuckets
from app.system.texts import TextLike, render, say

# The latest samples, limited by age and bytes.

OVERHEAD_BYTES: Final = 512  # memory of a sample besides its payload
COPY_BELOW_BYTES: Final = (
    64 * 1024
)  # a smaller payload is copied, so that it does not keep its receive buffer


@dataclass(frozen=True, slots=True)
class Buffered:
    """A sample of the topic `key`; `size` is its memory in bytes."""

    key: str
    sample: Sample
    size: int


def times_of(sample: Sample) -> tuple[int, int]:
    """When a sample was received and sent, in nanoseconds since the epoch."""
    received = round(sample.wall * 1e9)
    return received, received if sample.sent is None else round(sample.sent * 1e6) * 1000


def to_buffered(key: str, sample: Sample) -> Buffered:
    """The sample to be buffered. A large payload is not copied until it is written."""
    length = len(sample.payload)
    if length < COPY_BELOW_BYTES:
        sample = sample._replace(payload=bytes(sample.payload))
    return Buffered(key, sample, length + OVERHEAD_BYTES)


class RingBuffer:
    """The newest samples: at most `max_age_s` seconds and `max_bytes` bytes."""

    def __init__(self, max_age_s: float, max_bytes: int) -> None:
        self._max_age_s = max_age_s
        self._max_bytes = max_bytes
        self._samples: deque[Buffered] = deque()
        self.size = 0

    def add(self, buffered: Buffered) -> None:
        """Adds a sample. One that is larger than the ring is ignored; the others are kept."""
        if buffered.size <= self._max_bytes and self._max_age_s > 0:
            self._samples.append(buffered)
            self.size += buffered.size
        self._drop_old(buffered.sample.at)

    def recent(self, now: float, most_s: float = math.inf) -> Iterator[Buffered]:
        """The samples that are at most `max_age_s`, and `most_s`, old at `now` (monotonic seconds),
        oldest first."""
        self._drop_old(now)
        yield from (buffered for buffered in self._samples if now - buffered.sample.at <= most_s)

    def _drop_old(self, now: float) -> None:
        while self._samples and (
            self.size > self._max_bytes or now - self._samples[0].sample.at > self._max_age_s
        ):
            self.size -= self._samples.popleft().size


# One recording as an MCAP file (mcap.dev): profile "ros2", messages as received.

FOLDER: Final = "recordings"  # of the data folder
SUFFIX: Final = ".mcap"
UNFINISHED: Final = ".mcap.unfinished"
PROFILE: Final = "ros2"
PRESS_TOPIC: Final = "/web_ui/presses"
PRESS_SCHEMA: Final[Mapping[str, Any]] = {
    "$schema": "https://json-schema.org/draft/2020-12/schema",
    "title": "web_ui/Press",
    "description": "A press when it is made, and again with its result.",
    "type": "object",
    "properties": {
        "id": {"type": "string"},
        "widget": {"type": "string"},
        "who": {"type": "string"},
        "values": {"type": "object"},
        "outcome": {"type": ["string", "null"]},
        "reason": {"type": ["string", "null"]},
        "at": {"type": "string", "format": "date-time"},
    },
}


@dataclass(frozen=True, slots=True)
class Channel:
    """A topic in a recording; `definition` is that of its type, in the format "ros2msg"."""

    topic: str
    type: str
    definition: str


class McapStream:
    """A recording that is written into a stream."""

    def __init__(self, stream: IO[bytes], about: Mapping[str, str]) -> None:
        self._channels: dict[str, int] = {}
        self._writer = Writer(stream, compression=CompressionType.ZSTD)
        self._writer.start(PROFILE)
        if about:
            self._writer.add_metadata("recording", dict(about))

    def add(self, channel: Channel, payload: bytes, received: int, sent: int) -> None:
        """Adds a message in CDR; times are nanoseconds since the epoch."""

        def register() -> int:
            schema = self._writer.register_schema(channel.type, "ros2msg", channel.definition.encode())
            return self._writer.register_channel(channel.topic, "cdr", schema)

        self._writer.add_message(self._channel(channel.topic, register), received, payload, sent)

    def add_press(self, press: Mapping[str, Any], at: int) -> None:
        """Adds a press in the form of `PRESS_SCHEMA`, and flushes the file."""

        def register() -> int:
            text = json.dumps(PRESS_SCHEMA).encode()
            schema = self._writer.register_schema(str(PRESS_SCHEMA["title"]), "jsonschema", text)
            return self._writer.register_channel(PRESS_TOPIC, "json", schema)

        self._writer.add_message(
            self._channel(PRESS_TOPIC, register), at, json.dumps(press).encode(), at
        )
        self._writer.flush()

    def add_raw(self, schema: Schema | None, channel: ChannelRecord, message: Message) -> None:
        """Adds a message of another file unchanged."""

        def register() -> int:
            own = 0
            if schema is not None:
                own = self._writer.register_schema(schema.name, schema.encoding, schema.data)
            return self._writer.register_channel(
                channel.topic, channel.message_encoding, own, channel.metadata
            )

        number = self._channel(channel.topic, register)
        self._writer.add_message(number, message.log_time, message.data, message.publish_time)

    def add_metadata(self, name: str, about: Mapping[str, str]) -> None:
        """Adds a metadata record."""
        self._writer.add_metadata(name, dict(about))

    def end(self) -> None:
        """Completes the recording; the stream stays open."""
        self._writer.finish()

    def _channel(self, topic: str, register: Callable[[], int]) -> int:
        if topic not in self._channels:
            self._channels[topic] = register()
        return self._channels[topic]


class McapFile(McapStream):
    """An MCAP file that is being written, until `finish` or `abandon`. Methods raise OSError.

    Until it is finished it has another suffix, and a lock that the system releases with the process.
    """

    def __init__(self, folder: Path, name: str, about: Mapping[str, str]) -> None:
        self._folder, self._path = folder, folder / f"{name}{UNFINISHED}"
        self._final_path = folder / f"{name}{SUFFIX}"
        flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC
        self._stream = os.fdopen(os.open(self._path, flags, 0o600), "wb")
        try:
            fcntl.flock(self._stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
            super().__init__(self._stream, about)
        except BaseException:
            self.abandon()
            raise

    def finish(self) -> Path:
        """Completes the file, syncs it and gives it its final name, which is returned."""
        self.end()
        self._stream.flush()
        os.fsync(self._stream.fileno())
        self._path.rename(self._final_path)
        self._stream.close()
        return self._final_path

    def abandon(self) -> None:
        """Removes the file, if possible."""
        with suppress(OSError):
            self._stream.close()
        with suppress(OSError):
            self._path.unlink()


def packed(messages: Iterable[tuple[Channel, bytes, int, int]], about: Mapping[str, str]) -> bytes:
    """A recording of messages in CDR, each with its channel and its times as `McapStream.add` has
    them."""
    stream = BytesIO()
    recording = McapStream(stream, about)
    for message in messages:
        recording.add(*message)
    recording.end()
    return stream.getvalue()


def recover(folder: Path, unfinished: Path) -> Path | None:
    """Copies the readable part of an unfinished file into a finished one and returns its path. None if
    it has no message, or if another process still writes it. OSError if it can't be written."""
    with open(unfinished, "rb") as stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return None
        file = McapFile(folder, f"{unfinished.name.removesuffix(UNFINISHED)}.recovered", {})
        try:
            recovered = _finish_recovered(file) if _copy_messages(stream, file) else None
        finally:
            file.abandon()  # if it is not finished
        unfinished.unlink()
    return recovered


def _finish_recovered(file: McapFile) -> Path:
    file.add_metadata("recovered", {"why": "the server ended while it was recording"})
    return file.finish()


def _copy_messages(stream: IO[bytes], file: McapFile) -> int:
    """Copies the readable records; returns the number of messages."""
    schemas: dict[int, Schema] = {}
    channels: dict[int, ChannelRecord] = {}
    count = 0
    for record in _read_records(stream):
        match record:
            case Schema():
                schemas[record.id] = record
            case ChannelRecord():
                channels[record.id] = record
            case Metadata():
                file.add_metadata(record.name, record.metadata)
            case Message() if channel := channels.get(record.channel_id):
                file.add_raw(schemas.get(channel.schema_id), channel, record)
                count += 1
    return count


def _read_records(stream: IO[bytes]) -> Iterator[McapRecord]:
    """The records before the first one that can't be read."""
    with suppress(Exception):
        yield from StreamReader(stream).records


# The folder of recordings: limits its size and finishes files of an earlier process.

log = logging.getLogger("kiosk.recording")


CLOCK_SKEW_S: Final = 60.0  # a file further in the future was written while the clock was wrong


def recording_name(moment: float, robot: str, widget: str) -> str:
    """A file's name without its suffix. Names sort by time. `moment` is in seconds since the epoch."""
    at = datetime.fromtimestamp(moment, UTC).strftime("%Y%m%dT%H%M%S.%f")[:-3] + "Z"
    return "-".join(filter(None, (at, robot, widget)))


class RecordingFolder:
    """The folder of recordings. Its methods raise OSError if it can't be used."""

    def __init__(self, path: Path, max_bytes: int) -> None:
        """`max_bytes` is the limit for finished and unfinished files together."""
        self.path = path
        self._max_bytes = max_bytes

    def open(self) -> None:
        """Creates the folder, and finishes the files that an earlier process left."""
        self.path.mkdir(mode=0o700, parents=True, exist_ok=True)
        self.make_room(0)
        for left in sorted(self.path.glob(f"*{UNFINISHED}")):
            if left.name.endswith(f".recovered{UNFINISHED}"):
                left.unlink()  # recovered again from its source below
        for left in sorted(self.path.glob(f"*{UNFINISHED}")):
            if recovered := recover(self.path, left):
                log.warning("%s was unfinished; its readable part is recovered", recovered)
        self.make_room(0)

    def make_room(self, size: int) -> None:
        """Removes the oldest recordings until `size` more bytes fit. Recordings from the future (the
        clock was set back) count as the oldest."""
        latest = recording_name(time.time() + CLOCK_SKEW_S, "", "")
        files = sorted(self.path.glob(f"*{SUFFIX}"), key=lambda file: (file.name < latest, file.name))
        sizes = [_size(file) for file in files]
        total = sum(sizes)
        for file, bytes_ in zip(files, sizes, strict=True):
            if total + size <= self._max_bytes:
                return
            file.unlink(missing_ok=True)
            total -= bytes_
            log.info("removed %s: recordings take %.0f MB at most", file.name, self._max_bytes / 1e6)


def _size(file: Path) -> int:
    """In bytes; 0 if someone has just removed the file."""
    with suppress(FileNotFoundError):
        return file.stat().st_size
    return 0


# The thread that writes recordings. Samples that it can't write in time are dropped.

MAX_QUEUED_BYTES: Final = 128 * 1024 * 1024  # not written yet, of all robots
MAX_RING_BYTES: Final = 64 * 1024 * 1024  # of all robots
STOP_TIMEOUT_S: Final = 5.0  # for the disk at shutdown

Work = Callable[[], None]


class Recordings:
    """The recordings of one panel, from `start` to `stop`.

    `fault` is the sentence for the operator while recordings can't be written, else "".
    """

    def __init__(self, path: Path, max_mb: float, robots: int) -> None:
        """Each of `robots` may have one open file; together they may fill half the folder."""
        most = int(max_mb * 1_000_000)
        self._folder = RecordingFolder(path, most)
        self.file_bytes = most // (2 * (robots + 1))
        self.ring_bytes = min(
            MAX_RING_BYTES // robots, self.file_bytes // 2
        )  # half is for samples after the press
        # One at a time: each holds its samples until it is done.
        self._writer: DiskWriter[Work] = DiskWriter(
            "recordings", self, most=MAX_QUEUED_BYTES, batch_most=1
        )
        self._open = 0
        self.fault: TextLike = ""
        self._listeners: list[Callable[[], None]] = []
        self._loop = asyncio.get_running_loop()

    def start(self) -> None:
        """Starts the thread, which first prepares the folder."""
        self._writer.start()

    def stop(self) -> None:
        """Writes what is queued; blocks for `STOP_TIMEOUT_S` at most."""
        if not self._writer.close(STOP_TIMEOUT_S):
            log.error("the disk is too slow: a recording is left unfinished")

    def add_listener(self, listener: Callable[[], None]) -> None:
        """`listener` is called on the event loop when `fault` has changed."""
        self._listeners.append(listener)

    def enqueue(self, size: int, work: Work) -> bool:
        """Queues `work`, which holds `size` bytes, for the thread; False if the queue is full."""
        return self._writer.put(work, size, bounded=size > 0)

    def begin(
        self, name: str, channels: Mapping[str, Channel], about: Mapping[str, str]
    ) -> "Recording":
        """A new recording; `channels` are by key."""
        return Recording(self, name, channels, about)

    # On the thread: `DiskFile`. A fault ends one recording, and never closes the folder.

    def open(self) -> None:
        """Prepares the folder."""
        try:
            self._folder.open()
        except Exception as error:
            self.report_failure(error)

    def write(self, items: Sequence[Work]) -> None:
        for work in items:
            try:
                work()
            except Exception:  # an error in one recording must not end the others
                log.exception("recording failed")

    def refuse(self, items: Sequence[Work], error: LogError) -> None:
        """`write` never fails."""

    def tidy(self, quiet: bool) -> None:
        """Each new file makes room for itself."""

    def idle_s(self) -> float:
        return math.inf

    def close(self, error: LogError | None) -> None:
        """Each recording closes its file."""

    # Below: on the thread, by recordings.

    def open_file(self, name: str, about: Mapping[str, str]) -> McapFile:
        self._folder.path.mkdir(mode=0o700, parents=True, exist_ok=True)
        self._folder.make_room((self._open + 1) * self.file_bytes)
        file = McapFile(self._folder.path, name, about)
        self._open += 1
        return file

    def release_file(self) -> None:
        self._open -= 1
        self._folder.make_room(self._open * self.file_bytes)

    def release_abandoned(self) -> None:
        self._open -= 1

    def clear_fault(self) -> None:
        self._set_fault("")

    def report_failure(self, error: Exception) -> None:
        """Sets the fault. The next press starts a new file."""
        why = os_error_text(error) if isinstance(error, OSError) else str(error)
        log.error("recording stopped, in %s: %s", self._folder.path, why)
        self._set_fault(say("recording_failed", why=why))

    def _set_fault(self, fault: TextLike) -> None:
        if fault != self.fault:
            self.fault = fault
            with suppress(RuntimeError):  # the loop is closed
                for listener in self._listeners:
                    self._loop.call_soon_threadsafe(listener)


class Recording:
    """One file, as the event loop uses it: all work is queued for the thread. When it `is_full` it
    takes no more samples, and the next press begins another file."""

    def __init__(
        self,
        all_: Recordings,
        name: str,
        channels: Mapping[str, Channel],
        about: Mapping[str, str],
    ) -> None:
        self._recordings = all_
        self._channels = channels
        self._bytes_left = all_.file_bytes
        self._dropped = 0
        self._file: McapFile | None = None
        self._abandoned = False
        self._accepted = all_.enqueue(
            OVERHEAD_BYTES, lambda: self._run_guarded(lambda: self._open_file(name, about))
        )

    @property
    def is_full(self) -> bool:
        return self._bytes_left <= 0 or self._abandoned or not self._accepted

    def add(self, buffered: Buffered) -> None:
        """Adds a sample."""
        self._bytes_left -= buffered.size
        if self.is_full or not self._recordings.enqueue(
            buffered.size, lambda: self._run_guarded(lambda: self._write_sample(buffered))
        ):
            self._dropped += 1

    def add_press(self, press: Mapping[str, Any], at: int) -> None:
        """Adds a press or its receipt, also to a full file. `at` is in nanoseconds since the epoch."""
        size = OVERHEAD_BYTES + len(str(press))
        self._recordings.enqueue(size, lambda: self._run_guarded(lambda: self._write_press(press, at)))

    def finish(self) -> None:
        self._recordings.enqueue(0, lambda: self._run_guarded(self._finish_file))

    # Below: on the thread.

    def _run_guarded(self, work: Work) -> None:
        try:
            work()
        except Exception as error:
            self._abandoned = True
            if self._file is not None:
                self._file.abandon()
                self._file = None
                self._recordings.release_abandoned()
            self._recordings.report_failure(error)

    def _open_file(self, name: str, about: Mapping[str, str]) -> None:
        self._file = self._recordings.open_file(name, about)

    def _write_sample(self, buffered: Buffered) -> None:
        if self._file is not None:
            sample = buffered.sample
            self._file.add(self._channels[buffered.key], bytes(sample.payload), *times_of(sample))

    def _write_press(self, press: Mapping[str, Any], at: int) -> None:
        if self._file is not None:
            self._file.add_press(press, at)

    def _finish_file(self) -> None:
        if self._file is None:
            return
        if self._dropped:
            self._file.add_metadata("left_out", {"samples": str(self._dropped)})
            log.warning("%d samples were not recorded: too many or too large", self._dropped)
        path = self._file.finish()
        self._file = None
        log.info("recorded %s", path)
        self._recordings.release_file()
        self._recordings.clear_fault()


# Records one robot's samples and presses around each press and each stop. Used on the event loop only.

RECHECK_S: Final = 1.0
LAST_S: Final = 60.0  # of the download of the last minute
MAX_WAIT_S: Final = 600.0  # how long a recording waits for the receipt of a press
STOP: Final = "stop"  # in the names of recordings that a stop began
STOP_BEFORE_S: Final = 30.0  # of a stop that its recording has at least
STOP_AFTER_S: Final = 5.0
STOPS: Final = Quota(5, per_s=1 / 60)  # that begin or extend a recording


class Recorder:
    """Keeps the ring buffer, and a recording from a press or a stop until `after_s` after the last."""

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
        usual = {*types} - {*panel.maps, *panel.map_updates}
        self._channels = {
            key: Channel(f"/{key}", types[topic], interfaces.definition(types[topic]))
            for topic in (usual if rules.topics is None else rules.topics)
            for key in robot.possible_keys(topic)
        }
        self._ring = RingBuffer(max(rules.before_s, LAST_S), recordings.ring_bytes)
        self._packing = asyncio.Lock()  # one at a time: each holds its samples
        self._recording: Recording | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._pending_presses: dict[str, str] = {}  # press → who
        self._last_event_at = 0.0  # monotonic seconds, of a press or a receipt
        self._since = 0.0  # monotonic seconds: from then on the recording has messages
        self._stopped_at = -math.inf  # monotonic seconds
        self._stops = TokenBuckets(STOPS)

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
            self._begin_recording(widget, self._rules.before_s)
        self._pending_presses[press_id] = who
        at = datetime.now(UTC).isoformat(timespec="milliseconds")
        self._write_press(id=press_id, widget=widget, who=who, values=dict(inputs), outcome=None,
                   reason=None, at=at)  # fmt: skip

    def record_receipt(self, receipt: Receipt) -> None:
        """A press got its receipt, or a correction of it."""
        who = self._pending_presses.pop(receipt.id, "")
        self._write_press(id=receipt.id, widget=receipt.widget, who=who, values=dict(receipt.inputs),
                   outcome=receipt.outcome, reason=render(receipt.reason), at=receipt.at)  # fmt: skip

    def record_stop(self) -> None:
        """The machine has stopped: `STOP_BEFORE_S` before it and `STOP_AFTER_S` after it at least are
        recorded. What happens within the latter is one stop; more than `STOPS` are not recorded."""
        now = time.monotonic()
        if now - self._stopped_at < STOP_AFTER_S or not self._stops.has_token(STOP):
            return
        self._stops.take_token(STOP)
        self._stopped_at = now
        before = max(self._rules.before_s, STOP_BEFORE_S)
        if self._recording is None or self._recording.is_full or self._since > now - before:
            self._begin_recording(STOP, before)
        self._last_event_at = now
        self._stop_after(max(self._rules.after_s, STOP_AFTER_S))

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

    def _begin_recording(self, cause: str, before_s: float) -> None:
        """`cause` is the id of a widget, or STOP."""
        self._close()
        name = recording_name(time.time(), self._robot_id, cause)
        about = self._metadata | {"before_s": f"{before_s:g}"}
        self._recording = self._recordings.begin(name, self._channels, about)
        now = time.monotonic()
        self._since = now - before_s
        for buffered in self._ring.recent(now, before_s):
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

"""One recording as an MCAP file (mcap.dev): profile "ros2", messages as received."""

import fcntl
import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import IO, Any, Final

from mcap.records import Channel as ChannelRecord
from mcap.records import McapRecord, Message, Metadata, Schema
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer

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

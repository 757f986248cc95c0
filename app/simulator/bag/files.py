"""The files of recordings: MCAP files, rosbag2's SQLite files, and folders with a metadata.yaml."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, Final, Protocol

from mcap.reader import make_reader
from mcap.records import Channel, Schema
from mcap.summary import Summary

from app.errors import RecordingError
from app.interfaces.names import Qos

try:
    from rosbags.interfaces import Connection, QosDurability, QosReliability
    from rosbags.interfaces import Qos as OfferedQos
    from rosbags.rosbag2.metadata import ReaderMetadata, parse_qos
    from rosbags.rosbag2.reader import DirectoryReader
    from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader
except ModuleNotFoundError as error:
    helps = '`pip install "operator-panel[replay]"`, in a checkout `make .venv/test`'
    raise RecordingError(f"replaying needs rosbags: {helps}") from error

if TYPE_CHECKING:
    from rosbags.rosbag2.reader import ReaderProtocol

RIGHT: Final = "it must be an .mcap or a .db3 file, or a folder of rosbag2 with a metadata.yaml"
FORMAT: Final = "cdr"
MCAP_MAGIC: Final = b"\x89MCAP0\r\n"  # at the beginning and at the end of a file
# What saves the messages of a damaged file, by its suffix.
RESCUE: Final[Mapping[str, str]] = {
    ".mcap": "`mcap recover {path} -o recovered.mcap` saves the messages that are whole",
    ".db3": '`sqlite3 {path} ".recover" | sqlite3 recovered.db3` saves the messages that are whole',
}

Recorded = tuple[int, str, bytes]  # ns since the epoch, topic, payload


@dataclass(frozen=True, slots=True)
class RecordedTopic:
    """A topic of a file. `format` is how its messages are serialized, `hash` that of its type or ""."""

    topic: str
    type: str
    format: str
    qos: Qos
    hash: str
    count: int


class RecordedFile(Protocol):
    """What reads one format."""

    start_ns: int
    end_ns: int
    topics: Sequence[RecordedTopic]
    notes: Sequence[str]  # what is not as it should be

    def messages(self, topics: Collection[str]) -> Iterator[Recorded]: ...
    def close(self) -> None: ...


def rescue(path: Path) -> str:
    """What helps, as the end of a sentence; "" for a folder, whose error names a file."""
    return f"; {RESCUE[path.suffix].format(path=path)}" if path.suffix in RESCUE else ""


def opener(path: Path) -> type["_Mcap"] | type["_Sqlite"] | type["_Folder"]:
    if not path.exists():
        raise RecordingError(f"{path} does not exist: {RIGHT}")
    if path.is_dir():
        if not (path / "metadata.yaml").is_file():
            helps = f"`ros2 bag reindex {path}` writes one for a bag whose recording was cut off"
            raise RecordingError(f"{path} has no metadata.yaml: {RIGHT}; {helps}")
        return _Folder
    if path.suffix == ".zstd":
        helps = f"play its folder, or unpack it: `zstd -d {path}`"
        raise RecordingError(f"{path} is a compressed file of a bag: {helps}")
    if path.suffix not in (".mcap", ".db3"):
        raise RecordingError(f"{path} is not a recording: {RIGHT}")
    return _Mcap if path.suffix == ".mcap" else _Sqlite


def _check_mcap_ends(path: Path) -> None:
    """RecordingError for a file that is not MCAP, or has no end: the library's errors are of the bytes
    where it looked for one."""
    with path.open("rb") as stream:
        begins = stream.read(len(MCAP_MAGIC))
        stream.seek(max(path.stat().st_size - len(MCAP_MAGIC), len(begins)))
        ends = stream.read()
    if begins != MCAP_MAGIC:
        raise RecordingError(f"{path} can't be read: it is not an MCAP file")
    if ends != MCAP_MAGIC:
        raise RecordingError(f"{path} was not finished, or is cut off{rescue(path)}")


class _Mcap:
    """An MCAP file, with whatever channels it has (mcap.dev)."""

    notes: Sequence[str] = ()

    def __init__(self, path: Path) -> None:
        _check_mcap_ends(path)
        self._stream: IO[bytes] = path.open("rb")
        try:
            self._reader = make_reader(self._stream, validate_crcs=True)
            summary = self._reader.get_summary()
            if summary is None or summary.statistics is None:
                raise RecordingError(f"{path} was not finished{rescue(path)}")
            statistics = summary.statistics
            self.start_ns, self.end_ns = statistics.message_start_time, statistics.message_end_time
            self.topics: Sequence[RecordedTopic] = [
                _of_channel(channel, summary) for channel in summary.channels.values()
            ]
        except BaseException:
            self.close()
            raise

    def messages(self, topics: Collection[str]) -> Iterator[Recorded]:
        for _, channel, message in self._reader.iter_messages(topics=list(topics)):
            if channel.message_encoding == FORMAT:
                yield message.log_time, channel.topic, message.data

    def close(self) -> None:
        self._stream.close()


def _of_channel(channel: Channel, summary: Summary) -> RecordedTopic:
    schema: Schema | None = summary.schemas.get(channel.schema_id)
    counts: Mapping[int, int] = summary.statistics.channel_message_counts if summary.statistics else {}
    return RecordedTopic(
        channel.topic,
        "" if schema is None else schema.name,
        channel.message_encoding,
        _qos(parse_qos(channel.metadata.get("offered_qos_profiles", ""))),
        channel.metadata.get("topic_type_hash", ""),
        counts.get(channel.id, 0),
    )


class _Sqlite:
    """One of rosbag2's SQLite files."""

    notes: Sequence[str] = ()

    def __init__(self, path: Path) -> None:
        self._reader = Sqlite3Reader(path)
        self._reader.open()
        self.start_ns, self.end_ns = _ends(self._reader.metadata)
        self.topics: Sequence[RecordedTopic] = [
            _of_connection(connection) for connection in self._reader.connections
        ]

    def messages(self, topics: Collection[str]) -> Iterator[Recorded]:
        yield from _stored(self._reader, topics)

    def close(self) -> None:
        self._reader.close()


class _Folder:
    """A folder of rosbag2. Its metadata.yaml names the files; their messages are those of the files'
    own topics, since the two differ: a publisher that appears later is in one of them only."""

    def __init__(self, path: Path) -> None:
        for file in sorted(path.glob("*.mcap")):
            _check_mcap_ends(file)
        self._reader = DirectoryReader(path)
        self._reader.open()
        self.start_ns, self.end_ns = _ends(self._reader.metadata)
        stored = [
            _of_connection(connection)
            for file in self._reader.storages
            for connection in file.connections
        ]
        # QoS and type as the folder has them, where it has the topic.
        named = [
            replace(_of_connection(connection), count=0) for connection in self._reader.connections
        ]
        self.topics: Sequence[RecordedTopic] = [*named, *stored]
        there, said = sum(topic.count for topic in stored), self._reader.metadata.message_count
        missing = f"{path}: its files have {there} messages, its metadata.yaml names {said}"
        self.notes: Sequence[str] = [missing] if there < said else []

    def messages(self, topics: Collection[str]) -> Iterator[Recorded]:
        for file in self._reader.storages:
            yield from _stored(file, topics)

    def close(self) -> None:
        self._reader.close()


def _ends(about: ReaderMetadata) -> tuple[int, int]:
    """The times of the first message and of the last: the library has the time after that."""
    return about.start_time, max(about.end_time - 1, about.start_time)


def _stored(file: "ReaderProtocol", topics: Collection[str]) -> Iterator[Recorded]:
    used = [connection for connection in file.connections if connection.topic in topics]
    with closing(file.messages(used)) as messages:
        for connection, at_ns, payload in messages:
            yield at_ns, connection.topic, bytes(payload)


def _of_connection(connection: Connection) -> RecordedTopic:
    encoding: str = getattr(connection.ext, "serialization_format", FORMAT)
    offered: list[OfferedQos] = getattr(connection.ext, "offered_qos_profiles", [])
    return RecordedTopic(
        connection.topic,
        connection.msgtype,
        encoding,
        _qos(offered),
        connection.digest,
        connection.msgcount,
    )


def _qos(offered: Sequence[Any]) -> Qos:
    """As the first publisher offered it; reliable and volatile if the file does not have it."""
    if not offered:
        return Qos()
    offer: OfferedQos = offered[0]
    return Qos(
        offer.reliability is not QosReliability.BEST_EFFORT,
        offer.durability is QosDurability.TRANSIENT_LOCAL,
        max(offer.depth, 1),
    )

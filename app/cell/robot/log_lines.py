"""The newest lines of a topic of `rcl_interfaces/msg/Log`: kept as they came, decoded at
their first reading."""

import asyncio
from collections.abc import Callable, Iterator, Mapping
from heapq import merge
from typing import Final, Literal, NamedTuple

from app.ros.messages import Interfaces
from app.ros.messages.names import ROSOUT_TOPIC, possible_keys
from app.ros.zenoh.sample import Buffer, Sample
from app.system.errors import DecodeError
from app.system.limits import BoundedQueue
from app.system.log import NODE_NAME
from app.system.printable import readable

LOG_TYPE: Final = "rcl_interfaces/msg/Log"
KEPT_BYTES: Final = 4_000_000
LONGEST_LINE: Final = 100_000  # bytes of a message; a longer one is counted, and not kept
LONGEST_TEXT: Final = 1_000  # characters of a line that are shown
MOST_READ: Final = 4 * LONGEST_TEXT  # with the codes of terminals
LONGEST_NAME: Final = 100
SLICE: Final = 50  # lines that are decoded in one turn of the event loop: some milliseconds
SEVERE: Final = 30  # from here on a line is kept apart
LEVEL_AT: Final = 12
NAME_LENGTH_AT: Final = 16
NAME_AT: Final = 20
# From the severity's number on; ROS 2 has 10, 20, 30, 40 and 50.
SEVERITIES: Final = ((50, "fatal"), (40, "error"), (30, "warn"), (20, "info"))


class Line(NamedTuple):
    """`severity` is ROS 2's number; `stamp` is the sender's time, in seconds since the epoch."""

    severity: int
    stamp: float
    node: str
    text: str

    @property
    def level(self) -> str:
        return next((name for least, name in SEVERITIES if self.severity >= least), "debug")


class LogPage(NamedTuple):
    """`lines` are (number, line), the newest last; `left_out` is how many more of those that were asked
    for there are, or were, and `last` the number of the newest line of all."""

    lines: list[tuple[int, Line]]
    left_out: int
    last: int


class LogFilter(NamedTuple):
    """Lines of at least a severity with these texts in the node's name and in the text, in any case."""

    severity: int = 0
    node: str = ""
    search: str = ""
    without: str = ""  # the node of this name
    translate: Callable[[str], str] = str  # the text as its reader has it

    def has(self, line: Line) -> bool:
        return (
            line.severity >= self.severity
            and line.node != (self.without or None)
            and self.node.lower() in line.node.lower()
            and self.search.casefold() in f"{line.text}\n{self.translate(line.text)}".casefold()
        )


class _Kept:
    """One line, decoded at its first reading."""

    __slots__ = ("line", "number", "payload")

    def __init__(self, number: int, payload: bytes) -> None:
        self.number = number
        self.payload: bytes | None = payload
        self.line: Line | None = None  # also where the payload is no line


class LogLines:
    """The lines of one topic, bounded in number and in bytes. Warnings and worse have a bound of their
    own: no flood of other lines takes them away."""

    def __init__(self, interfaces: Interfaces, keep: int) -> None:
        self._interfaces = interfaces
        self._severe: BoundedQueue[_Kept] = BoundedQueue(keep, KEPT_BYTES)
        self._others: BoundedQueue[_Kept] = BoundedQueue(keep, KEPT_BYTES)
        self.count = 0  # of all that came

    def add(self, payload: Buffer, namespace: str = "") -> None:
        """A message came; it is not decoded. Of a topic of several robots only the lines of nodes in
        `namespace`, and the panel server's own, are the robot's."""
        data = bytes(payload)
        if namespace and not _is_of(logger_name(data), namespace):
            return
        self.count += 1
        if len(data) > LONGEST_LINE:
            return
        queue = self._severe if _is_severe(data) else self._others
        queue.add(_Kept(self.count, data), len(data))

    async def find(self, wanted: LogFilter, after: int, most: int) -> LogPage:
        """The newest lines with a number above `after`, over as many turns as decoding takes."""
        for number, kept in enumerate(self._since(after)):
            if kept.payload is not None:
                self._decode(kept)
            if number % SLICE == SLICE - 1:
                await asyncio.sleep(0)
        return self._select(wanted, after, most)

    def newest(self, wanted: LogFilter, most: int) -> LogPage:
        """The newest of the last few lines at once, for a page that is rendered; also of the last few
        warnings and worse."""
        for queue in (self._severe, self._others):
            for kept in list(queue)[-SLICE:]:
                self._decode(kept)
        return self._select(wanted, 0, most)

    def _select(self, wanted: LogFilter, after: int, most: int) -> LogPage:
        read = (kept for kept in self._since(after) if kept.line is not None)
        fitting = [(kept.number, kept.line) for kept in read if kept.line and wanted.has(kept.line)]
        shown = fitting[-most:]
        return LogPage(shown, len(fitting) - len(shown) + self._gone(after), self.count)

    def _gone(self, after: int) -> int:
        """How many lines above `after` are not kept any more; 0 where all are asked for."""
        if not after:
            return 0
        first = self._others[0].number if self._others else self.count + 1
        severe = sum(after < kept.number < first for kept in self._severe)
        return max(0, first - after - 1 - severe)

    def _since(self, after: int) -> Iterator[_Kept]:
        """A copy: more may come while they are read."""
        both = merge(self._severe, self._others, key=lambda kept: kept.number)
        return iter([kept for kept in both if kept.number > after])

    def _decode(self, kept: _Kept) -> None:
        payload, kept.payload = kept.payload, None
        if payload is None:
            return
        try:
            message = self._interfaces.decode(LOG_TYPE, payload)
        except DecodeError:
            return
        stamp = message.stamp.sec + message.stamp.nanosec / 1e9
        text = readable(message.msg[:MOST_READ])[: LONGEST_TEXT + 1]
        if len(text) > LONGEST_TEXT:
            text = text[: LONGEST_TEXT - 1] + "…"
        kept.line = Line(message.level, stamp, readable(message.name[:LONGEST_NAME]), text)


def _is_of(name: str, namespace: str) -> bool:
    """Whether a logger is that of a node in a namespace: `robot1.driver` in `robot1`."""
    return name == NODE_NAME or name.startswith(f"{namespace.replace('/', '.')}.")


def logger_name(data: bytes) -> str:
    """The name in an encoded line, "" where it is cut: behind the level, with its length."""
    order: Literal["little", "big"] = "little" if data[1:2] == b"\1" else "big"
    end = NAME_AT + int.from_bytes(data[NAME_LENGTH_AT:NAME_AT], order)
    return data[NAME_AT:end].rstrip(b"\0").decode(errors="replace") if end <= len(data) else ""


def _is_severe(data: bytes) -> bool:
    """Whether an encoded line is a warning or worse: its level is behind the header and the stamp."""
    return len(data) > LEVEL_AT and data[LEVEL_AT] >= SEVERE


class LogListener:
    """The `SampleListener` of a robot's logs: adds the samples of each to its lines."""

    def __init__(self, lines: Mapping[str, LogLines], namespace: str) -> None:
        """`lines` are by the topic's key. `namespace` is the robot's: nodes of other robots publish on
        the same /rosout, unless their bridge puts a namespace before it."""
        self._lines = lines
        self._namespaces = {
            key: f"{namespace}/".removeprefix(f"/{key.removesuffix(ROSOUT_TOPIC)}/").strip("/")
            for key in possible_keys(ROSOUT_TOPIC, namespace)
        }

    @property
    def keys(self) -> frozenset[str]:
        return frozenset(self._lines)

    def record_sample(self, key: str, sample: Sample) -> None:
        """A line was received."""
        self._lines[key].add(sample.payload, self._namespaces.get(key, ""))

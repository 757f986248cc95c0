"""The server's log: its format, its levels, and the limit of repeated records."""

import logging
import sys
import time
import traceback
from collections.abc import Callable, Hashable, Mapping, MutableMapping
from dataclasses import dataclass
from typing import Any, Final

from app.system.printable import printable

# Log output in ROS 2's format: `[INFO] [1704573791.462327908] [web_ui]: message`.
#
# Format and level numbers are those of rcutils and rcl_interfaces/msg/Log.

NODE_NAME = "web_ui"

# Python level → (ROS severity name, its number in rcl_interfaces/msg/Log)
SEVERITIES: Mapping[int, tuple[str, int]] = {
    logging.DEBUG: ("DEBUG", 10),
    logging.INFO: ("INFO", 20),
    logging.WARNING: ("WARN", 30),
    logging.ERROR: ("ERROR", 40),
    logging.CRITICAL: ("FATAL", 50),
}
LEVELS: Mapping[str, int] = {name.lower(): level for level, (name, _) in SEVERITIES.items()}

log = logging.getLogger("kiosk")


def ros_severity(record: logging.LogRecord) -> tuple[str, int]:
    """The nearest ROS severity at or below the record's level."""
    return SEVERITIES[max((at for at in SEVERITIES if at <= record.levelno), default=logging.DEBUG)]


def record_stamp(record: logging.LogRecord) -> tuple[int, int]:
    """Seconds and nanoseconds since the epoch."""
    return divmod(int(record.created * 1e9), 1_000_000_000)


class RobotLog(logging.LoggerAdapter[logging.Logger]):
    """A logger of one robot: records begin with the robot's name and go to its /rosout only."""

    def __init__(self, logger: logging.Logger, robot: str) -> None:
        """`robot` is the robot's name, "" if the panel has only one."""
        super().__init__(logger, {"robot": robot})
        self._prefix = f"{robot}: " if robot else ""

    def process(
        self, msg: Any, kwargs: MutableMapping[str, Any]
    ) -> tuple[Any, MutableMapping[str, Any]]:
        prefixed = {name: f"{self._prefix}{text}" for name, text in kwargs.get("extra", {}).items()}
        extra = {**(self.extra or {}), **prefixed}
        return f"{self._prefix.replace('%', '%%')}{msg}", {**kwargs, "extra": extra}


class RosFormatter(logging.Formatter):
    """Formats a record as one line. Further lines are indented, so that no text can look like a
    record."""

    def format(self, record: logging.LogRecord) -> str:
        name, _ = ros_severity(record)
        seconds, nanoseconds = record_stamp(record)
        lines = printable(super().format(record)).replace("\n", "\n  ")
        return f"[{name}] [{seconds}.{nanoseconds:09}] [{NODE_NAME}]: {lines}"


def rosout_extra(text: str) -> Mapping[str, str]:
    """The `extra` of a record with another text on /rosout: every node of the robot can read that, so
    it must not contain what an operator typed."""
    return {"rosout": text}


class RosoutHandler(logging.Handler):
    """Passes each record to a callback as the fields of `rcl_interfaces/msg/Log`.

    The callback runs on the thread that logs. Its exceptions are dropped: a failure to send a record
    must not create another record.
    """

    def __init__(self, publish: Callable[[Mapping[str, object]], None], robot: str = "") -> None:
        super().__init__()
        self._publish = publish
        self._robot = robot

    def emit(self, record: logging.LogRecord) -> None:
        if getattr(record, "robot", self._robot) != self._robot:
            return
        try:
            self._publish(log_fields(record))
        except Exception:
            self.handleError(record)

    def handleError(self, record: logging.LogRecord) -> None:
        pass


def log_fields(record: logging.LogRecord) -> dict[str, object]:
    """A record as the fields of `rcl_interfaces/msg/Log`."""
    seconds, nanoseconds = record_stamp(record)
    text = getattr(record, "rosout", None) or record.getMessage()
    if record.exc_info:
        text += "\n" + logging.Formatter().formatException(record.exc_info)
    return {
        "stamp": {"sec": seconds, "nanosec": nanoseconds},
        "level": ros_severity(record)[1],
        "name": NODE_NAME,
        "msg": printable(text),
        "file": record.filename,
        "function": record.funcName or "",
        "line": record.lineno,
    }


def configure_logging(level: str) -> None:
    """Sends all log records at `level` and above to stderr in ROS 2's format.

    uvicorn configures its loggers before it imports the application; they are redirected. Its line for
    each request is logged at `debug` only.
    """
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(RosFormatter())
    root = logging.getLogger()
    root.handlers = [handler]
    root.setLevel(max(logging.WARNING, LEVELS[level]))
    log.setLevel(LEVELS[level])
    for name in ("uvicorn", "uvicorn.error", "uvicorn.access"):
        logger = logging.getLogger(name)
        logger.handlers = []
        logger.propagate = True
        logger.setLevel(LEVELS[level])
    if level != "debug":
        logging.getLogger("uvicorn.access").setLevel(root.level)


# Repeated records of a logger are counted in place of being written, so that a client which causes one
# again and again does not fill the log.

COUNTED_FOR_S: Final = 60.0
KINDS_MOST: Final = 100
COUNTED: Final = "counted"  # marks the record with the count


@dataclass(slots=True)
class _Kind:
    """Records of a kind: the first was written at `since` (monotonic seconds), `more` were not."""

    since: float
    level: int
    text: str
    more: int = 0


class RepeatedRecords(logging.Filter):
    """Lets the first warning or error of a kind pass, and counts those that follow within
    `COUNTED_FOR_S`. `write_counts` has to be called from time to time."""

    def __init__(self, monotonic: Callable[[], float] = time.monotonic) -> None:
        super().__init__()
        self._monotonic = monotonic
        self._kinds: dict[Hashable, _Kind] = {}

    def filter(self, record: logging.LogRecord) -> bool:
        if record.levelno < logging.WARNING or getattr(record, COUNTED, False):
            return True
        key, now = kind_of(record), self._monotonic()
        kind = self._kinds.get(key)
        if kind is not None:
            kind.more += 1
            return False
        if len(self._kinds) < KINDS_MOST:
            self._kinds[key] = _Kind(now, record.levelno, record.getMessage().strip())
        return True

    def write_counts(self, log: logging.Logger) -> None:
        """Writes a line for each kind that came more than once in its time."""
        now = self._monotonic()
        for key, kind in list(self._kinds.items()):
            if now - kind.since < COUNTED_FOR_S:
                continue
            del self._kinds[key]
            if kind.more:
                about = {COUNTED: True}
                log.log(kind.level, "%s: %d more in the last minute", kind.text, kind.more, extra=about)


def kind_of(record: logging.LogRecord) -> Hashable:
    """Records are of one kind if their message has the same template and an exception was raised at the
    same place."""
    error = record.exc_info[1] if record.exc_info else None
    if error is None:
        return record.name, record.msg
    frames = traceback.extract_tb(error.__traceback__)
    place = (frames[-1].filename, frames[-1].lineno) if frames else None
    return record.name, record.msg, type(error), place

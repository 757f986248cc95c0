"""Log output in ROS 2's format: `[INFO] [1704573791.462327908] [web_ui]: message`.

Format and level numbers are those of rcutils and rcl_interfaces/msg/Log.
"""

import logging
import sys
from collections.abc import Callable, Mapping, MutableMapping
from typing import Any

from app.printable import printable

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

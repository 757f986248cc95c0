"""Log lines as ROS 2 writes them: one record, one line, whatever is in it."""

import logging
import re
import sys
from collections.abc import Iterator, Mapping

import pytest

from app.ros.messages import load_interfaces
from app.system.log import LEVELS, RobotLog, RosFormatter, RosoutHandler, configure_logging, log_fields

LINE = re.compile(r"\[(DEBUG|INFO|WARN|ERROR|FATAL)\] \[\d+\.\d{9}\] \[web_ui\]: ")


def record(text: str, *about: object, level: int = logging.INFO) -> logging.LogRecord:
    made = logging.LogRecord("kiosk", level, "/app/kiosk.py", 42, text, about, None, "start")
    made.created = 1704573791.5
    return made


def raised() -> logging.LogRecord:
    made = record("failed", level=logging.ERROR)
    try:
        raise ValueError("first\n[INFO] [1.000000000] [web_ui]: forged")
    except ValueError:
        made.exc_info = sys.exc_info()
    return made


@pytest.fixture
def logging_as_before() -> Iterator[None]:
    names = ("kiosk", "uvicorn", "uvicorn.error", "uvicorn.access")
    loggers = [logging.getLogger(), *map(logging.getLogger, names)]
    before = [(logger, logger.handlers, logger.level, logger.propagate) for logger in loggers]
    yield
    for logger, handlers, level, propagate in before:
        logger.handlers, logger.propagate = handlers, propagate
        logger.setLevel(level)


def test_a_line_is_as_ros_writes_it() -> None:
    line = RosFormatter().format(record("bridge %s found", "b1"))
    assert line == "[INFO] [1704573791.500000000] [web_ui]: bridge b1 found"


@pytest.mark.parametrize(
    ("level", "name", "number"),
    [
        (logging.DEBUG, "DEBUG", 10),
        (logging.INFO, "INFO", 20),
        (logging.WARNING, "WARN", 30),
        (logging.ERROR, "ERROR", 40),
        (logging.CRITICAL, "FATAL", 50),
        (logging.INFO + 5, "INFO", 20),
        (logging.CRITICAL + 10, "FATAL", 50),
        (1, "DEBUG", 10),
    ],
)
def test_a_level_has_the_name_and_number_of_ros(level: int, name: str, number: int) -> None:
    made = record("x", level=level)
    assert RosFormatter().format(made).startswith(f"[{name}] ")
    assert log_fields(made)["level"] == number


def test_a_newline_in_a_message_begins_no_record() -> None:
    lines = RosFormatter().format(record("a\n[FATAL] [1.000000000] [web_ui]: forged")).split("\n")
    assert [bool(LINE.match(line)) for line in lines] == [True, False]


@pytest.mark.parametrize("control", ["\r", "\x1b", "\0", "\x07", "\x0b", "\x0c", "\x7f", "\u202e"])
def test_a_control_character_is_escaped(control: str) -> None:
    line = RosFormatter().format(record("a%sb", control))
    assert line.endswith(f"a\\u{ord(control):04x}b")


def test_a_traceback_follows_indented() -> None:
    first, *rest = RosFormatter().format(raised()).split("\n")
    assert LINE.match(first)
    assert any("ValueError" in line for line in rest)
    assert all(line.startswith("  ") for line in rest)


def test_a_record_becomes_the_fields_of_the_ros_log_message() -> None:
    assert log_fields(record("bridge %s lost", "b1", level=logging.WARNING)) == {
        "stamp": {"sec": 1704573791, "nanosec": 500_000_000},
        "level": 30,
        "name": "web_ui",
        "msg": "bridge b1 lost",
        "file": "kiosk.py",
        "function": "start",
        "line": 42,
    }


@pytest.mark.parametrize(
    ("text", "sent"),
    [
        ("plain", "plain"),
        ("two\nlines", "two\nlines"),
        ("NUL \0 inside", "NUL \\u0000 inside"),
        ("漢字", "漢字"),
        ("a\u202eb\ud800", "a\\u202eb\\ud800"),
        ("a \x85 b \u2028 c \x1b[2J", "a \\u0085 b \\u2028 c \\u001b[2J"),
    ],
)
def test_a_record_can_be_sent_on_rosout(text: str, sent: str) -> None:
    interfaces = load_interfaces("jazzy")
    payload = interfaces.encode("rcl_interfaces/msg/Log", log_fields(record(text)))
    assert interfaces.decode("rcl_interfaces/msg/Log", payload).msg == sent


def test_rosout_gets_each_record() -> None:
    sent: list[Mapping[str, object]] = []
    RosoutHandler(sent.append).handle(record("hello"))
    assert [fields["msg"] for fields in sent] == ["hello"]


def test_a_record_that_can_not_be_sent_is_dropped_in_silence(
    capsys: pytest.CaptureFixture[str],
) -> None:
    def refuse(fields: Mapping[str, object]) -> None:
        raise RuntimeError("no link")

    RosoutHandler(refuse).handle(record("hello"))
    assert capsys.readouterr().err == ""


@pytest.mark.usefixtures("logging_as_before")
@pytest.mark.parametrize("level", list(LEVELS))
def test_the_kiosk_logs_at_its_level_and_above(level: str, capsys: pytest.CaptureFixture[str]) -> None:
    configure_logging(level)
    for number in LEVELS.values():
        logging.getLogger("kiosk.part").log(number, "level %d", number)
    shown = re.findall(r"level (\d+)", capsys.readouterr().err)
    assert shown == [str(number) for number in LEVELS.values() if number >= LEVELS[level]]


@pytest.mark.usefixtures("logging_as_before")
def test_uvicorn_logs_in_the_same_format(capsys: pytest.CaptureFixture[str]) -> None:
    configure_logging("info")
    logging.getLogger("uvicorn.error").info("Uvicorn running")
    line = capsys.readouterr().err
    assert LINE.match(line)
    assert line.endswith("Uvicorn running\n")


@pytest.mark.usefixtures("logging_as_before")
@pytest.mark.parametrize(("level", "shown"), [("debug", True), ("info", False)])
def test_a_line_per_request_comes_with_debug_only(
    level: str, shown: bool, capsys: pytest.CaptureFixture[str]
) -> None:
    configure_logging(level)
    logging.getLogger("uvicorn.access").info("GET /")
    assert ("GET /" in capsys.readouterr().err) is shown


@pytest.mark.parametrize("control", ["\x9b", "\x85", "\u2028"])
def test_a_control_of_the_upper_half_is_escaped_too(control: str) -> None:
    line = RosFormatter().format(
        logging.makeLogRecord({"msg": f"a{control}2Jb", "levelno": logging.INFO})
    )
    assert control not in line
    assert line.endswith(f"a\\u{ord(control):04x}2Jb")


@pytest.mark.usefixtures("logging_as_before")
def test_others_are_logged_at_the_level_too(capsys: pytest.CaptureFixture[str]) -> None:
    configure_logging("error")
    logging.getLogger("asyncio").warning("too quiet")
    logging.getLogger("asyncio").error("loud enough")
    shown = capsys.readouterr().err
    assert "too quiet" not in shown
    assert "loud enough" in shown


def test_rosout_gets_the_exception_and_half_a_surrogate_as_text() -> None:
    try:
        raise ValueError("the cause")
    except ValueError:
        record = logging.makeLogRecord(
            {"msg": "it failed \ud800", "levelno": logging.ERROR, "exc_info": sys.exc_info()}
        )
    text = str(log_fields(record)["msg"])
    assert "it failed \\ud800" in text
    assert "ValueError: the cause" in text


def test_log_of_several_robots_is_separate_and_named() -> None:
    first: list[Mapping[str, object]] = []
    second: list[Mapping[str, object]] = []
    logger = logging.getLogger("test.robots")
    logger.propagate = False
    logger.handlers = [RosoutHandler(first.append, "Robot 1"), RosoutHandler(second.append, "100 %")]
    RobotLog(logger, "Robot 1").warning("bridge %s lost", "b1")
    RobotLog(logger, "100 %").warning("bridge %s lost", "b2")
    logger.warning("of all")
    assert [fields["msg"] for fields in first] == ["Robot 1: bridge b1 lost", "of all"]
    assert [fields["msg"] for fields in second] == ["100 %: bridge b2 lost", "of all"]

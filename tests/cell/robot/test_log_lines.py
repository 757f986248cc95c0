"""The lines of a log, bounded and decoded when they are read."""

import asyncio
from collections.abc import Sequence

import pytest

from app.cell.robot import log_lines
from app.cell.robot.log_lines import LOG_TYPE, LONGEST_TEXT, LogFilter, LogLines, LogListener, LogPage
from app.ros.messages import load_interfaces
from app.ros.zenoh.sample import Sample
from app.system.log import NODE_NAME

INTERFACES = load_interfaces("jazzy", ())
NODES = ["arm", "left.arm", "left.io.door", "leftover.arm", "right.arm", NODE_NAME]


def line(number: int, level: int = 20, node: str = "arm", text: str = "moves") -> bytes:
    fields = {"stamp": {"sec": number}, "level": level, "name": node, "msg": f"{text} {number}"}
    return INTERFACES.encode(LOG_TYPE, fields)


def filled(payloads: Sequence[bytes], keep: int = 100) -> LogLines:
    lines = LogLines(INTERFACES, keep)
    for payload in payloads:
        lines.add(payload)
    return lines


def find(lines: LogLines, wanted: LogFilter | None = None, after: int = 0, most: int = 50) -> LogPage:
    return asyncio.run(lines.find(wanted or LogFilter(), after, most))


def numbers(result: LogPage) -> list[int]:
    return [number for number, _ in result.lines]


def test_only_the_newest_are_kept() -> None:
    lines = filled([line(n) for n in range(1, 151)])
    result = find(lines, most=200)
    assert (numbers(result), result.last) == (list(range(51, 151)), 150)


@pytest.mark.parametrize(
    ("namespace", "key", "shown"),
    [
        ("", "rosout", NODES),
        ("/left", "rosout", ["left.arm", "left.io.door", NODE_NAME]),
        ("/left", "left/rosout", NODES),
        ("/left/io", "rosout", ["left.io.door", NODE_NAME]),
        ("/plant/left", "plant/rosout", ["left.arm", "left.io.door", NODE_NAME]),
    ],
)
def test_a_robot_shows_the_lines_of_its_own_nodes(namespace: str, key: str, shown: list[str]) -> None:
    """Several robots share /rosout, unless a bridge puts a namespace before it."""
    lines = LogLines(INTERFACES, 100)
    listener = LogListener({key: lines}, namespace)
    for number, node in enumerate(NODES, 1):
        listener.record_sample(key, Sample(line(number, node=node), number, 0.0, 0.0, None))
    listener.record_sample(key, Sample(line(9)[:18], 9, 0.0, 0.0, None))
    assert [each.node for _, each in find(lines).lines] == shown


def test_their_bytes_are_bounded_too(monkeypatch: pytest.MonkeyPatch) -> None:
    payload = line(1, text="x" * 900)
    monkeypatch.setattr(log_lines, "KEPT_BYTES", 3 * len(payload))
    lines = filled([payload] * 10)
    assert numbers(find(lines)) == [8, 9, 10]


def test_a_line_that_is_too_long_is_counted_and_not_kept() -> None:
    lines = filled([line(1), line(2, text="x" * 100_000), line(3)])
    result = find(lines)
    assert (numbers(result), result.last) == ([1, 3], 3)


def test_of_too_many_the_newest_are_found_and_the_others_counted() -> None:
    lines = filled([line(n) for n in range(1, 101)])
    result = find(lines, most=10)
    assert (numbers(result), result.left_out) == (list(range(91, 101)), 90)
    later = find(lines, after=95, most=3)
    assert (numbers(later), later.left_out) == ([98, 99, 100], 2)


def test_a_flood_takes_no_warning_away() -> None:
    lines = filled([line(1, 40, text="hot"), *(line(n) for n in range(2, 400)), line(400, 30)])
    assert numbers(find(lines, LogFilter(severity=30))) == [1, 400]
    assert numbers(lines.newest(LogFilter(severity=30), 50)) == [1, 400]
    assert numbers(find(lines, most=200)) == [1, *range(300, 401)]
    assert find(lines, after=200, most=200).left_out == 99


def test_those_that_are_not_kept_any_more_are_counted() -> None:
    lines = filled([line(n) for n in range(1, 201)])
    assert find(lines, after=20, most=100).left_out == 80


@pytest.mark.parametrize(
    ("wanted", "fitting"),
    [
        (LogFilter(severity=30), [2, 3]),
        (LogFilter(node="GRIP"), [3]),
        (LogFilter(search="Slow"), [2]),
        (LogFilter(without="web_ui"), [1, 2, 3]),
        (LogFilter(severity=30, node="arm", search="slow"), [2]),
    ],
)
def test_lines_are_chosen(wanted: LogFilter, fitting: list[int]) -> None:
    payloads = [
        line(1),
        line(2, 30, text="slow"),
        line(3, 50, node="gripper"),
        line(4, 10, node="web_ui"),
    ]
    assert numbers(find(filled(payloads), wanted)) == fitting


def test_colours_of_a_terminal_are_no_text() -> None:
    long = "\x1b[31m" + "x" * (LONGEST_TEXT - 2) + "\x1b[0m"
    lines = filled([line(1, text="\x1b[1;33m[WARN]\x1b[0m hot"), line(2, text=long)])
    shown = [log_line.text for _, log_line in find(lines).lines]
    assert shown == ["[WARN] hot 1", "x" * (LONGEST_TEXT - 2) + " 2"]


def test_invalid_log_message_is_skipped_and_control_characters_show() -> None:
    payloads = [b"\0\1\0\0nonsense", line(2, text="a\u202eb")]
    ((number, log_line),) = find(filled(payloads)).lines
    assert (number, log_line.text) == (2, "a\\u202eb 2")


@pytest.mark.parametrize(
    ("level", "word"),
    [(0, "debug"), (10, "debug"), (20, "info"), (30, "warn"), (40, "error"), (50, "fatal")],
)
def test_a_severity_has_its_word(level: int, word: str) -> None:
    ((_, log_line),) = find(filled([line(1, level)])).lines
    assert log_line.level == word


def test_log_lines_are_decoded_when_read(monkeypatch: pytest.MonkeyPatch) -> None:
    decoded: list[bytes] = []
    lines = filled([line(n) for n in range(1, 101)])
    real = INTERFACES.decode

    def decode(type_name: str, payload: bytes) -> object:
        decoded.append(payload)
        return real(type_name, payload)

    monkeypatch.setattr(INTERFACES, "decode", decode)
    assert not decoded
    find(lines)
    find(lines, LogFilter(search="moves"))
    assert len(decoded) == 100  # each once

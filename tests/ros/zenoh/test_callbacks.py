"""A callback on a thread of Zenoh's that fails: the next message arrives, the log has it once, the
metrics count it."""

import logging
import re
import sys
from collections.abc import Iterator
from typing import Any, Final

import pytest
import zenoh

from app.ros.zenoh.answers import FAILED, callback_errors, direct
from app.system.log import RepeatedRecords
from app.web.metrics import Metrics
from app.web.prometheus import exposition
from tests.support.parts import CALLBACK_FAILED, ROOT, Process, until

ALONE: Final = '{mode: "peer", scouting: {multicast: {enabled: false}}, listen: {endpoints: []}}'
MESSAGES: Final = 50


class Records(logging.Handler):
    def __init__(self) -> None:
        super().__init__()
        self.records: list[logging.LogRecord] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.records.append(record)


@pytest.fixture
def records(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[logging.LogRecord]]:
    """What the logger of callbacks writes, limited as in a server."""
    monkeypatch.setattr(callback_errors, "count", 0)
    logger, handler, limit = logging.getLogger("kiosk.zenoh"), Records(), RepeatedRecords()
    logger.addHandler(handler)
    logger.addFilter(limit)
    yield handler.records
    logger.removeHandler(handler)
    logger.removeFilter(limit)


@pytest.fixture
def session() -> Iterator[zenoh.Session]:
    with zenoh.open(zenoh.Config.from_json5(ALONE)) as opened:
        yield opened


def test_what_a_callback_raises_is_logged_once_and_counted(
    session: zenoh.Session, records: list[logging.LogRecord]
) -> None:
    arrived: list[bytes] = []

    def take(sample: zenoh.Sample) -> None:
        arrived.append(sample.payload.to_bytes())
        raise ValueError("broken")

    declared = session.declare_subscriber("callbacks/*", direct(take))
    for number in range(MESSAGES):
        session.put(f"callbacks/{number}", str(number))
    until(lambda: callback_errors.count == MESSAGES, "all have failed")
    assert len(arrived) == MESSAGES
    (record,) = records
    assert (record.msg, record.levelno) == (FAILED, logging.ERROR)
    assert record.exc_info
    assert isinstance(record.exc_info[1], ValueError)
    text, _ = exposition(Metrics())
    assert f"kiosk_zenoh_callback_errors_total {MESSAGES}.0" in text.decode()
    declared.undeclare()


def test_a_wrong_signature_is_such_an_error(
    session: zenoh.Session, records: list[logging.LogRecord]
) -> None:
    """As that of a method that a test has replaced."""

    def without_event() -> None: ...

    replaced: Any = without_event
    declared = session.declare_subscriber("callbacks/*", direct(replaced))
    session.put("callbacks/one", b"")
    until(lambda: callback_errors.count, "it has failed")
    assert records[0].exc_info
    assert isinstance(records[0].exc_info[1], TypeError)
    declared.undeclare()


def test_a_server_in_whose_log_such_an_error_is_fails_its_test() -> None:
    assert FAILED.startswith(CALLBACK_FAILED)
    process = Process([sys.executable, "-c", f"import sys; sys.exit({FAILED!r})"], {})
    until(lambda: FAILED in process.text, "it has written the line")
    with pytest.raises(AssertionError, match="a callback on a thread"):
        process.end()


def test_the_package_has_no_other_callbacks() -> None:
    """Each of Zenoh's handlers is one of `direct`, but those of the simulator: it knows nothing of
    the server."""
    made = re.compile(r"\bCallback\(")
    files = {path for path in (ROOT / "app").rglob("*.py") if made.search(path.read_text())}
    assert files == {ROOT / "app/ros/zenoh/answers.py", ROOT / "app/tools/simulator/zenoh.py"}

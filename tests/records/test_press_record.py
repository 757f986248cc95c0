"""What a press writes into the operator's log, and when: before it is sent, and the result."""

import asyncio
import json
from collections.abc import Callable, Collection, Coroutine, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from app.cell.commands.receipts import Receipt
from app.panel.model import Panel
from app.panel.template import needed_inputs
from app.panel.widgets.hold import Hold
from app.records import Entry, Filter, Limits, OpenPress, OperatorLog, Origin
from app.records.database import rows
from app.records.entry import IDLE
from app.records.press_record import Log, PressLog
from app.records.principal import Client, Principal
from app.system.errors import LogError
from tests.support.builders import (
    COUNT,
    GUARDED,
    INTERFACES,
    MESSAGE,
    VIEW,
    FakeTransport,
    panel_of,
    permits,
    press_of,
    press_widget,
    presses_of,
    robot_there,
    small_panel,
)
from tests.support.waiting import when

KIM = Principal(Client("b1", "10.0.0.7", False, 1), user="Kim")
SEEN = f"{VIEW}-1"
SET = {
    "id": "light",
    "kind": "call",
    "label": "Light",
    "service": "/light",
    "type": "std_srvs/srv/SetBool",
    "request": {"data": True},
    "timeout_s": 0.05,
}
SPEED = {"id": "speed", "kind": "number", "label": "Speed", "min": 0, "max": 9}
JOG = {
    "id": "jog",
    "kind": "hold",
    "label": "Jog",
    "topic": "/jog",
    "type": "std_msgs/msg/Int32",
    "message": {"data": "{speed}"},
    "release": {"data": 0},
    "interlock": "operation",
}
FULL = "The operator's log cannot be written: no space left on device."


class SlowLog:
    """A log whose disk takes its time, or takes nothing: it writes down what happened when."""

    fault = ""
    lock = ""

    def __init__(self, happened: list[str]) -> None:
        self._happened = happened
        self.begun = asyncio.Semaphore(0)  # released by each write that begins
        self.written = asyncio.Event()
        self.fails = False
        self.not_on_disk = ""
        self.entries: list[Entry] = []

    @contextmanager
    def notifying(self, changed: Callable[[], None]) -> Iterator[None]:
        yield

    async def pressed(self, entry: Entry) -> Entry | None:
        self._happened.append("written")
        self.begun.release()
        await self.written.wait()
        if self.fails:
            raise LogError(FULL)
        return self._kept(entry)

    async def closed(self, entry: Entry) -> str:
        self._kept(entry)
        await asyncio.sleep(0)
        self._happened.append("on the disk")
        return self.not_on_disk

    def add(self, entry: Entry) -> None:
        self._kept(entry)

    def allowed(self, origin: Origin) -> bool:
        return True

    def suppress(self, origin: Origin, limited: bool = False) -> None:
        raise AssertionError("there is room for all")

    async def open_presses(self, robot: str, widgets: Collection[str], since: int) -> list[OpenPress]:
        return []

    def _kept(self, entry: Entry) -> Entry:
        self.entries.append(entry.sealed(len(self.entries) + 1, "boot", ""))
        return self.entries[-1]


class Bench(FakeTransport):
    """Presses on a robot that is there and permits; what is asked of it is answered by the test."""

    def __init__(self, log: Log, happened: list[str], panel: Panel | None = None) -> None:
        panel = panel or small_panel()
        self.happened = happened
        self.robot = robot_there(panel)
        self.queries: list[asyncio.Future[bytes | None]] = []
        self.queried = asyncio.Semaphore(0)  # released by each query
        permits(self.robot)
        self.presses = presses_of(
            panel, self.robot, self, press_log=PressLog(log, "arm", lambda: "boot-3")
        )
        for service in ("light",):
            self.robot.graph.apply_token(f"@/b1/@ros2_lv/SS/{service}/std_srvs§srv§SetBool", True)

    def put(self, key: str, payload: bytes) -> None:
        self.happened.append("sent")

    def query(self, key: str, payload: bytes, timeout_s: float) -> "asyncio.Future[bytes | None]":
        self.happened.append("sent")
        self.queries.append(asyncio.get_running_loop().create_future())
        self.queried.release()
        return self.queries[-1]

    async def press(self, widget: str = "guarded", press_id: str = "p1", **inputs: Any) -> Receipt:
        inputs = inputs or {"message": "hi"}
        return await press_widget(self.presses, widget, inputs, press_id, KIM, SEEN)

    async def cancel(self, widget: str) -> Receipt:
        return await self.presses.cancel(press_of(self.presses.widget(widget), {}, "", KIM))


def slow(
    work: Callable[[SlowLog, Bench], Coroutine[Any, Any, None]], panel: Panel | None = None
) -> None:
    async def benched() -> None:
        happened: list[str] = []
        log = SlowLog(happened)
        await work(log, Bench(log, happened, panel))

    asyncio.run(benched())


def real(
    folder: Path,
    work: Callable[[Bench], Coroutine[Any, Any, None]],
    panel: Panel | None = None,
) -> list[Entry]:
    """What is in a real log after the work, the oldest first, without its beginning."""

    async def benched() -> None:
        log = OperatorLog(folder, Limits())
        await log.start()
        await work(Bench(log, [], panel))
        await log.stop()

    asyncio.run(benched())
    return [row.entry for row in reversed(rows(folder, Filter(every=True), None, 1000))][1:]


def test_a_press_is_written_then_sent_then_on_the_disk_then_answered() -> None:
    async def work(log: SlowLog, bench: Bench) -> None:
        task = asyncio.create_task(bench.press())
        await log.begun.acquire()
        assert bench.happened == ["written"]
        log.written.set()
        assert (await task).outcome == "published"
        assert bench.happened == ["written", "sent", "on the disk"]

    slow(work)


def test_a_lock_that_arrives_while_the_disk_is_busy_wins() -> None:
    async def work(log: SlowLog, bench: Bench) -> None:
        task = asyncio.create_task(bench.press())
        await log.begun.acquire()
        permits(bench.robot, False)
        log.written.set()
        receipt = await task
        assert (receipt.outcome, receipt.cause) == ("refused", "interlock")
        assert "sent" not in bench.happened
        assert [(e.kind, e.outcome, e.verdict) for e in log.entries] == [
            ("pressed", "", ""),
            ("closed", "refused", "interlock_not_permitted"),
        ]

    slow(work)


def test_press_that_cannot_be_logged_is_not_sent() -> None:
    async def work(log: SlowLog, bench: Bench) -> None:
        log.written.set()
        log.fails = True
        receipt = await bench.press()
        assert (receipt.outcome, receipt.cause) == ("refused", "log")
        assert str(receipt.reason).endswith(FULL)
        assert str(receipt.reason).startswith("Not sent at ")
        assert bench.happened == ["written"]
        log.fails = False
        assert await bench.press() is receipt
        assert (await bench.press(press_id="p2")).outcome == "published"

    slow(work)


def test_a_receipt_says_when_it_is_not_on_the_disk() -> None:
    async def work(log: SlowLog, bench: Bench) -> None:
        log.written.set()
        log.not_on_disk = "input/output error"
        receipt = await bench.press()
        assert receipt.outcome == "published"
        assert str(receipt.reason).endswith(" (Not safely in the operator's log: input/output error.)")

    slow(work)


def test_a_double_press_of_one_id_is_written_and_sent_once() -> None:
    async def work(log: SlowLog, bench: Bench) -> None:
        both = [asyncio.create_task(bench.press()) for _ in range(2)]
        await log.begun.acquire()
        log.written.set()
        first, second = await asyncio.gather(*both)
        assert first is second
        assert bench.happened == ["written", "sent", "on the disk"]

    slow(work)


def test_two_presses_of_one_service_wait_for_the_disk_and_one_is_sent() -> None:
    async def work(log: SlowLog, bench: Bench) -> None:
        both = [asyncio.create_task(bench.press("light", press_id=f"p{n}")) for n in range(2)]
        await log.begun.acquire()
        await log.begun.acquire()
        log.written.set()
        outcomes = [receipt.outcome for receipt in await asyncio.gather(*both)]
        assert outcomes == ["timed_out", "refused"]
        assert bench.happened.count("sent") == 1
        assert {e.verdict for e in log.entries if e.outcome == "refused"} == {"press_in_progress"}
        bench.queries[0].cancel()

    slow(work, panel_of(SET, *_message()))


def test_no_log_keeps_anybody_from_canceling() -> None:
    async def work(log: SlowLog, bench: Bench) -> None:
        log.written.set()
        log.fails = True
        bench.robot.command_status["count"] = IDLE
        receipt = await bench.cancel("count")
        assert "nothing is in progress" in str(receipt.reason)
        assert "Not safely in the operator's log" in str(receipt.reason)

    slow(work, panel_of(COUNT, *_message()))


def test_a_cancel_does_not_wait_for_the_log() -> None:
    types = INTERFACES.action_types("example_interfaces/action/Fibonacci")

    async def work(log: SlowLog, bench: Bench) -> None:
        bench.robot.graph.apply_token(
            "@/b1/@ros2_lv/AS/count/example_interfaces§action§Fibonacci", True
        )
        log.written.set()
        press = asyncio.create_task(bench.press("count"))
        await log.begun.acquire()
        await bench.queried.acquire()
        accepted = {"accepted": True, "stamp": {"sec": 0, "nanosec": 0}}
        bench.queries[0].set_result(INTERFACES.encode(types.send_goal_response, accepted))
        assert (await press).outcome == "accepted"
        log.written.clear()
        bench.happened.clear()
        cancel = asyncio.create_task(bench.cancel("count"))
        await log.begun.acquire()
        await bench.queried.acquire()
        assert sorted(bench.happened) == ["sent", "written"]  # its entry is still being written
        assert not log.written.is_set()
        bench.queries[-1].set_result(None)
        log.written.set()
        assert (await cancel).outcome == "unknown"
        assert [e.action for e in log.entries if e.kind == "closed"] == ["press", "cancel"]

    slow(work, panel_of(COUNT, *_message()))


def test_a_fault_of_the_servers_own_is_closed_as_unknown(monkeypatch: pytest.MonkeyPatch) -> None:
    async def work(log: SlowLog, bench: Bench) -> None:
        log.written.set()

        def fails(key: str, payload: bytes) -> None:
            raise ZeroDivisionError

        monkeypatch.setattr(bench, "put", fails)
        with pytest.raises(ZeroDivisionError):
            await bench.press()
        assert [(e.kind, e.outcome) for e in log.entries] == [("pressed", ""), ("closed", "unknown")]

    slow(work)


def test_a_press_that_is_given_up_while_it_waits_is_closed_as_unknown() -> None:
    async def work(log: SlowLog, bench: Bench) -> None:
        log.written.set()
        task = asyncio.create_task(bench.press("light"))
        await bench.queried.acquire()
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        assert [(e.kind, e.outcome) for e in log.entries] == [("pressed", ""), ("closed", "unknown")]
        bench.queries[0].cancel()

    slow(work, panel_of(SET, *_message()))


def test_log_entry_names_client_command_widget_and_state(tmp_path: Path) -> None:
    async def work(bench: Bench) -> None:
        await bench.press()

    opened, closed = real(tmp_path, work)
    for entry in (opened, closed):
        assert (entry.address, entry.browser, entry.who, entry.seen) == (
            "10.0.0.7", "b1", "Kim", SEEN,
        )  # fmt: skip
        assert (entry.robot, entry.press, entry.widget, entry.action) == (
            "arm", "p1", "guarded", "press",
        )  # fmt: skip
        assert json.loads(entry.values) == {"message": "hi"}
    assert (closed.outcome, closed.verdict, closed.board) == ("published", "permitted", "boot-3")
    assert closed.reason.startswith("Sent at ")


def test_an_entry_and_a_receipt_have_the_values_of_their_own_press_only(tmp_path: Path) -> None:
    """A page sends all that is entered on it."""
    other = {**SPEED, "id": "other"}
    panel = panel_of(MESSAGE, GUARDED, SPEED, other, JOG)

    async def work(bench: Bench) -> None:
        assert (await bench.press(message="hi", speed=7, other=3)).inputs == {"message": "hi"}
        assert (await bench.press(message="", speed=7)).inputs == {"message": ""}  # the id again
        refused = await bench.press(press_id="p2", message="hi", nothing=3)
        assert "nothing" in str(refused.reason)
        assert refused.entered == {"message": "hi", "nothing": 3}

    values = [json.loads(entry.values) for entry in real(tmp_path, work, panel) if not entry.of]
    assert values == [{"message": "hi"}, {"message": ""}, {"message": "hi"}]
    jog = next(widget for widget in panel.widgets() if isinstance(widget, Hold))
    assert needed_inputs(jog, {"speed": 7, "message": "hi"}) == {"speed": 7}


def test_an_entry_has_the_defaults_that_a_press_used(tmp_path: Path) -> None:
    async def work(bench: Bench) -> None:
        await bench.press(other="x")

    panel = panel_of({**MESSAGE, "default": "hi"}, {**MESSAGE, "id": "other"}, GUARDED)
    pressed, *_ = real(tmp_path, work, panel)
    assert json.loads(pressed.values) == {"message": "hi"}


def test_every_refusal_is_in_the_log(tmp_path: Path) -> None:
    async def work(bench: Bench) -> None:
        await bench.press("free", "p1", message="too long for it")
        permits(bench.robot, False)
        await bench.press("guarded", "p2")
        await bench.press("free", "p2")
        await press_widget(bench.presses, "free", {"message": "hi"}, "p3", KIM, "0ther-7")

    entries = [entry for entry in real(tmp_path, work) if entry.kind != "pressed"]
    assert [entry.outcome for entry in entries] == ["refused"] * 4
    assert [entry.kind for entry in entries] == ["closed", "closed", "refused", "closed"]
    words = ("characters long", "does not permit", "already used", "panel server restarted")
    assert all(word in entry.reason for word, entry in zip(words, entries, strict=True))


def test_a_late_answer_is_a_further_entry(tmp_path: Path) -> None:
    answer = INTERFACES.encode("std_srvs/srv/SetBool_Response", {"success": True, "message": "on"})

    async def work(bench: Bench) -> None:
        assert (await bench.press("light")).outcome == "timed_out"
        bench.queries[0].set_result(answer)
        await when(lambda: getattr(bench.presses.receipt("p1"), "outcome", "") == "succeeded")

    opened, closed, corrected = real(tmp_path, work, panel_of(SET, *_message()))
    assert (closed.of, closed.outcome) == (opened.seq, "timed_out")
    assert (corrected.of, corrected.kind, corrected.outcome) == (opened.seq, "corrected", "succeeded")


def _message() -> tuple[dict[str, Any], ...]:
    return ({"id": "message", "kind": "text", "label": "Message", "max_length": 8},)

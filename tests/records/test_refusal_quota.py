"""How many refusals are entries of the operator's log: by a clock that the test sets, then for real."""

import asyncio
import json
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest

from app.cell.commands.presses import Presses
from app.cell.commands.receipts import RECEIPTS_KEPT, Receipt
from app.cell.robot.state import RobotState
from app.records import Entry, Filter, Limits, OperatorLog, Origin
from app.records import log as audit_log
from app.records.database import rows
from app.records.log import MAX_BROWSERS, OF_ADDRESS, OF_ALL, OF_BROWSER, RefusalQuota
from app.records.press_record import PressLog, origin_of
from app.records.principal import Client, Principal
from app.records.store import Store
from app.records.verify import verify
from app.system.errors import LogError
from app.system.limits import MAX_BUCKETS
from tests.support.builders import (
    COUNT,
    FakeTransport,
    panel_of,
    permits,
    press_of,
    press_widget,
    presses_of,
    robot_there,
    small_panel,
)
from tests.support.holds import PANEL, PATIENT
from tests.support.parts import Server, until
from tests.support.servers import demo_server
from tests.support.waiting import turns, when
from tests.support.words import english
from tests.web.test_hold_socket import opened

PANEL_1 = Principal(Client("b1", "10.0.0.7", False, 1))
PANEL_2 = Principal(Client("b2", "10.0.0.8", False, 2))
KIM, LEE = origin_of(PANEL_1), origin_of(PANEL_2)
ENOUGH = 2 * int(OF_BROWSER.burst)
DRIVE = """
[[page.widget]]
id = "drive"
kind = "publish"
label = "Drive"
topic = "/drive"
type = "std_msgs/msg/Float64"
message = { data = "{speed}" }
"""


@pytest.fixture
def demo(tmp_path: Path) -> Iterator[Server]:
    with demo_server(tmp_path, PANEL + DRIVE, app=PATIENT) as mine:
        yield mine


class Counted:
    """Refusals as they come, some of them entries."""

    def __init__(self) -> None:
        self.now = 0.0
        self.refusals = RefusalQuota(lambda: self.now, lambda: 1_000_000.0)

    def come(self, origin: Origin, times: int) -> int:
        """How many became entries."""
        entries = 0
        for _ in range(times):
            if self.refusals.allowed(origin):
                self.refusals.count(origin)
                entries += 1
            else:
                self.refusals.suppress(origin)
        return entries


@pytest.fixture
def counted() -> Counted:
    return Counted()


def test_browser_has_a_burst_of_logged_refusals_then_one_per_interval(counted: Counted) -> None:
    assert counted.come(KIM, ENOUGH) == OF_BROWSER.burst
    counted.now += 10 / OF_BROWSER.per_s
    assert counted.come(KIM, ENOUGH) == 10
    counted.now += 1e6
    assert counted.come(KIM, ENOUGH) == OF_BROWSER.burst


def test_refusals_of_a_browser_do_not_use_up_the_quota_of_another(counted: Counted) -> None:
    counted.come(KIM, 10_000)
    assert counted.come(LEE, 10) == 10


def test_address_that_changes_its_cookies_has_its_own_quota(counted: Counted) -> None:
    entries = sum(
        counted.come(Origin(address="10.0.0.7", browser=f"b{number}"), 10) for number in range(1000)
    )
    assert entries == OF_ADDRESS.burst
    assert counted.come(LEE, 10) == 10


def test_all_together_have_a_bound(counted: Counted) -> None:
    entries = sum(counted.come(Origin(address=f"10.0.1.{number}"), 50) for number in range(1000))
    assert entries == OF_ALL.burst
    day = 86_400
    for _ in range(day // 10):
        counted.now += 10
        entries += sum(counted.come(Origin(address=f"10.0.2.{number}"), 1) for number in range(20))
    assert entries <= OF_ALL.burst + day * OF_ALL.per_s


def test_quota_remembers_a_bounded_number_of_browsers(counted: Counted) -> None:
    for number in range(10_000):
        counted.now += 1 / OF_ALL.per_s
        counted.come(Origin(address=f"10.1.{number}", browser="b"), 1)
    assert len(counted.refusals._browsers) == MAX_BUCKETS


def test_suppressed_refusals_are_counted_by_browser_and_the_rest_together(counted: Counted) -> None:
    counted.come(KIM, 60 + 7)
    for number in range(2 * MAX_BROWSERS):
        counted.come(Origin(address=f"10.0.0.{number}", browser="c"), 61)
    summaries = counted.refusals.summary_due()
    assert len(summaries) == MAX_BROWSERS + 1
    assert summaries[0].reason.startswith("7 more refusals from Panel 1 (10.0.0.7) since ")
    assert (summaries[0].kind, summaries[0].outcome, summaries[0].browser) == (
        "refused",
        "refused",
        "b1",
    )
    assert json.loads(summaries[0].values) == {"more": 7}
    assert summaries[-1].reason.split(" since")[0].endswith("more refusals from others")
    assert sum(json.loads(entry.values)["more"] for entry in summaries) == counted.refusals.left_out
    assert counted.refusals.summary_due() == []


class Cell(FakeTransport):
    """A robot with its presses, on a real log."""

    def __init__(self, log: OperatorLog) -> None:
        self.log = log
        self.sent = 0
        self.robot: RobotState = robot_there(small_panel())
        permits(self.robot)
        self.logbook = PressLog(log)
        self.presses: Presses = presses_of(small_panel(), self.robot, self, press_log=self.logbook)

    def put(self, key: str, payload: bytes) -> None:
        self.sent += 1

    async def press(self, press_id: str, who: Principal = PANEL_1, **inputs: Any) -> Receipt:
        inputs = inputs or {"message": "hi"}
        return await press_widget(self.presses, "guarded", inputs, press_id, who)


def written(folder: Path, work: Callable[[Cell], Any], limits: Limits | None = None) -> list[Entry]:
    """All of a log, the oldest first, when the work is done."""

    async def done() -> None:
        log = OperatorLog(folder, limits or Limits())
        await log.start()
        try:
            await work(Cell(log))
        finally:
            await log.stop()

    asyncio.run(done())
    assert verify(folder).fault == ""
    return [row.entry for row in reversed(rows(folder, Filter(every=True), None, 10_000))]


def test_a_flood_of_refused_presses_leaves_the_log_as_it_was(tmp_path: Path) -> None:
    async def work(cell: Cell) -> None:
        assert (await cell.press("first")).outcome == "published"
        permits(cell.robot, False)
        for number in range(2000):
            receipt = await cell.press(f"f{number}")
            assert (receipt.outcome, receipt.cause) == ("refused", "interlock")
            assert "does not permit operation" in str(receipt.reason)
        assert cell.log.left_out == 2000 - OF_BROWSER.burst
        assert (await cell.press("other", PANEL_2)).outcome == "refused"

    entries = written(tmp_path, work)
    assert len(entries) < 2 * OF_BROWSER.burst + 10
    assert [e.outcome for e in entries if e.press == "first"] == ["", "published"]
    assert [e.outcome for e in entries if e.press == "other"] == ["", "refused"]
    (more,) = [entry for entry in entries if "more refusals" in entry.reason]
    assert json.loads(more.values) == {"more": 2000 - OF_BROWSER.burst}


def test_they_are_summed_up_while_the_flood_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(audit_log, "SUMMARY_INTERVAL_S", 0.05)

    async def work(cell: Cell) -> None:
        permits(cell.robot, False)
        for number in range(ENOUGH):
            await cell.press(f"f{number}")
        await when(lambda: rows(tmp_path, Filter(text="more refusals", every=True), None, 10))

    written(tmp_path, work)


def test_sent_presses_are_never_limited(tmp_path: Path) -> None:
    """Who has used up what there is for refusals goes on pressing, and each press is in the log."""

    async def work(cell: Cell) -> None:
        permits(cell.robot, False)
        for number in range(ENOUGH):
            await cell.press(f"f{number}")
        permits(cell.robot)
        for number in range(300):
            assert (await cell.press(f"p{number}")).outcome == "published"
        assert cell.sent == 300

    entries = written(tmp_path, work)
    assert sum(entry.outcome == "published" for entry in entries) == 300


@pytest.mark.parametrize("inputs", [{"message": "much too long"}, {"nothing": 1}])
def test_invalid_input_is_limited_too_and_says_its_error(tmp_path: Path, inputs: Any) -> None:
    async def work(cell: Cell) -> None:
        first = await cell.press("first", **inputs)
        for number in range(ENOUGH):
            last = await cell.press(f"f{number}", **inputs)
        assert (last.outcome, last.cause) == ("refused", "input")
        assert str(last.reason)[22:] == str(first.reason)[22:]
        assert cell.log.left_out == ENOUGH + 1 - OF_BROWSER.burst

    written(tmp_path, work)


def test_a_used_id_is_limited_too(tmp_path: Path) -> None:
    async def work(cell: Cell) -> None:
        await cell.press("p")
        for _ in range(ENOUGH):
            receipt = await cell.press("p", message="other")
            assert "already used" in str(receipt.reason)
        assert cell.log.left_out == ENOUGH - OF_BROWSER.burst

    written(tmp_path, work)


def test_the_same_id_is_the_same_press_and_displaces_no_other(tmp_path: Path) -> None:
    async def work(cell: Cell) -> None:
        sent = await cell.press("sent")
        permits(cell.robot, False)
        for number in range(RECEIPTS_KEPT + ENOUGH):
            last = await cell.press(f"f{number}")
        permits(cell.robot)
        assert await cell.press(last.id) is last
        assert await cell.press("sent") is sent
        assert cell.sent == 1

    written(tmp_path, work)


def test_cancels_of_unknown_goals_are_limited_too(tmp_path: Path) -> None:
    async def work(cell: Cell) -> None:
        presses = presses_of(
            panel_of(COUNT), robot_there(panel_of(COUNT)), cell, press_log=cell.logbook
        )
        for _ in range(ENOUGH):
            receipt = await presses.cancel(press_of(presses.widget("count"), {}, "", PANEL_1))
            assert english(receipt.reason) == "nothing is in progress"
        assert cell.log.left_out == ENOUGH - OF_BROWSER.burst

    written(tmp_path, work)


def test_while_the_log_is_broken_they_are_kept_for_a_summary(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(audit_log, "SUMMARY_INTERVAL_S", 0.02)
    append, broken = Store.append, asyncio.Event()

    def appended(store: Store, entries: Sequence[Entry]) -> list[Entry]:
        if broken.is_set():
            raise LogError("no space left on device")
        return append(store, entries)

    monkeypatch.setattr(Store, "append", appended)

    async def work(cell: Cell) -> None:
        permits(cell.robot, False)
        for number in range(int(OF_BROWSER.burst)):
            await cell.press(f"f{number}")
        broken.set()
        assert (await cell.press("p", PANEL_2)).cause == "log"
        cell.log.suppress(KIM)
        await when(lambda: cell.log.fault)
        broken.clear()
        await when(lambda: not cell.log.fault)
        await turns()

    entries = written(tmp_path, work)
    assert sum("1 more refusals from Panel 1" in entry.reason for entry in entries) == 1


def test_a_flood_on_a_server(demo: Server) -> None:
    """Presses and holds of one browser, with what they leave in the log and in the metrics."""

    def held() -> dict[str, Any]:
        with opened(demo) as socket:
            return socket.begin(inputs={"speed": 99})

    for _ in range(ENOUGH):
        assert demo.press("drive", inputs={"speed": 99}).status_code == 422
    for _ in range(20):
        said = until(
            lambda: (response := held())["status"] != 429 and response, "there is room for a hold"
        )
        assert (said["state"], said["status"]) == ("refused", 422)
        assert "Speed is 99" in said["reason"]
    left_out = ENOUGH + 20 - OF_BROWSER.burst
    assert f"kiosk_refusals_left_out_total {left_out}" in demo.http.get("/metrics").text
    entries = demo.http.get("/log.csv?outcome=refused&every=true").text.splitlines()[1:]
    assert len(entries) == OF_BROWSER.burst

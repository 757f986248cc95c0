"""A check by the doctor and the support bundle as acts: guarded, logged, one at a time."""

import asyncio

from app.cell.commands.acts import ActContext, ActReceipt, ActRequest, ActRunner
from app.cell.commands.diagnostic_acts import DIAGNOSTIC_ACTS
from app.cell.permission.verdict import locked
from app.records.press_record import PressLog
from tests.cell.commands.test_acts import ANN, Guard, Log


class Checker:
    def __init__(self, is_busy: bool = False) -> None:
        self.is_busy = is_busy
        self.begun = 0

    def begin_check(self) -> None:
        self.begun += 1
        self.is_busy = True


class Page:
    def __init__(self, doctor: Checker, guard: Guard | None = None) -> None:
        self.log = Log()
        context = ActContext(guard or Guard(), PressLog(self.log, ""), "", lambda: None)
        self.runner = ActRunner("diagnostics", DIAGNOSTIC_ACTS, doctor, context)

    def act(self, act: str, act_id: str = "a1") -> ActReceipt:
        return asyncio.run(self.runner.act(ActRequest(act, ANN), act_id))


def test_a_check_begins_once_and_is_logged() -> None:
    doctor = Checker()
    page = Page(doctor)
    assert page.act("check").outcome == "accepted"
    assert page.act("check", "a2").outcome == "accepted"  # the one that runs
    assert doctor.begun == 1
    assert [(entry.kind, entry.action) for entry in page.log.entries] == [
        ("diagnostics", "diagnostics_check")
    ] * 2
    assert page.log.entries[0].reason == "The doctor began a check."


def test_a_bundle_waits_for_no_check() -> None:
    receipt = Page(Checker(is_busy=True)).act("bundle")
    assert (receipt.outcome, receipt.code) == ("refused", "diagnostics_busy")
    page = Page(Checker())
    assert page.act("bundle").outcome == "succeeded"
    assert page.log.entries[0].action == "diagnostics_bundle"


def test_without_a_log_neither_is_done() -> None:
    doctor = Checker()
    guard = Guard()
    guard.verdict = locked("press_clock_ahead")
    page = Page(doctor, guard)
    assert [page.act(act, act).outcome for act in DIAGNOSTIC_ACTS] == ["refused"] * 3
    assert doctor.begun == 0

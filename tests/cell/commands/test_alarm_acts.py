"""Acts on alarms: applied once, logged with who and what, refused with a sentence."""

import asyncio
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest

from app.cell.alarms.states import Override, State
from app.cell.commands.acts import ActContext, ActReceipt, ActRequest, ActRunner
from app.cell.commands.alarm_acts import ALARM_ACTS
from app.records.press_record import PressLog
from app.system.errors import InputError
from tests.cell.alarms.test_engine import AIR, START, Cell
from tests.cell.commands.test_acts import ANN, BOB, Guard, Log

LATCHED = AIR + "latched = true\n"


class Panel:
    """A cell with a raised alarm, and its acts."""

    def __init__(self, folder: Path, alarms: str = AIR) -> None:
        self.cell = Cell(folder, alarms)
        self.cell.publish(4.5)
        self.log = Log()
        context = ActContext(Guard(), PressLog(self.log, "Robot 1"), "", lambda: None)
        self.runner = ActRunner("alarm", ALARM_ACTS, self.cell.engine, context)

    def act(self, act: str, act_id: str, alarm: str = "air", **values: Any) -> ActReceipt:
        return asyncio.run(self.runner.act(ActRequest(act, ANN, alarm, values), act_id))


@pytest.fixture
def panel(tmp_path: Path) -> Panel:
    return Panel(tmp_path)


def at(seconds: float) -> str:
    return datetime.fromtimestamp(START + seconds, UTC).isoformat()


def test_an_acknowledgement_is_applied_once_and_logged_with_its_occurrence(panel: Panel) -> None:
    receipt = panel.act("acknowledge", "a1", occurrence=1)
    assert receipt.outcome == "succeeded"
    assert panel.act("acknowledge", "a1", occurrence=1) is receipt
    assert panel.cell.status().state is State.ACKNOWLEDGED
    (logged,) = panel.log.entries
    assert (logged.kind, logged.action, logged.values) == (
        "alarm",
        "alarm_acknowledge",
        '{"occurrence": 1}',
    )
    assert logged.reason == "Acknowledged: Air pressure low."
    assert [t.actor for t in panel.cell.transitions if t.act] == [str(ANN)]


def test_an_alarm_that_came_again_under_the_finger_is_not_acknowledged(panel: Panel) -> None:
    panel.cell.publish(6.0)
    panel.cell.publish(4.5)
    receipt = panel.act("acknowledge", "a1", occurrence=1)
    assert (receipt.outcome, receipt.code) == ("refused", "alarm_came_again")
    assert panel.cell.status().state is State.UNACKNOWLEDGED


def test_a_second_acknowledgement_is_done_already(panel: Panel) -> None:
    panel.act("acknowledge", "a1", occurrence=1)
    assert panel.act("acknowledge", "a2", occurrence=1).outcome == "succeeded"
    assert len([t for t in panel.cell.transitions if t.act]) == 1


def test_a_shelf_has_its_end_and_its_reason(panel: Panel) -> None:
    assert panel.act("shelve", "a1", until=at(600), reason="Tests").outcome == "succeeded"
    shelf = panel.cell.status().shelf
    assert shelf is not None
    assert (shelf.until, shelf.reason, shelf.actor) == (START + 600, "Tests", str(ANN))
    assert panel.act("unshelve", "a2").outcome == "succeeded"
    assert panel.cell.status().override is None
    for values in ({"until": at(9 * 3600), "reason": "Tests"}, {"until": at(-1), "reason": "Tests"}):
        assert panel.act("shelve", f"b{values['until']}", **values).code == "alarm_shelve_too_long"
    assert panel.act("shelve", "a4", until=at(60)).code == "alarm_reason_missing"


def test_out_of_service_and_back(panel: Panel) -> None:
    assert panel.act("out_of_service", "a1", reason="Rebuilt").outcome == "succeeded"
    assert panel.cell.status().override is Override.OUT_OF_SERVICE
    assert panel.act("in_service", "a2").outcome == "succeeded"
    assert panel.cell.status().occurrence == 2


def test_a_latched_alarm_is_reset_last(tmp_path: Path) -> None:
    panel = Panel(tmp_path, LATCHED)
    assert panel.act("reset", "a1").code == "alarm_still_active"
    panel.cell.publish(6.0)
    assert panel.act("reset", "a2").code == "alarm_acknowledge_first"
    panel.act("acknowledge", "a3", occurrence=1)
    assert panel.act("reset", "a4").outcome == "succeeded"
    assert panel.cell.status().is_normal


def test_an_alarm_that_is_not_there_is_refused_with_a_sentence(panel: Panel) -> None:
    receipt = panel.act("acknowledge", "a1", alarm="oil", occurrence=1)
    assert (receipt.outcome, receipt.code) == ("refused", "alarm_gone")


@pytest.mark.parametrize(
    ("act", "values"),
    [
        ("acknowledge", {}),
        ("acknowledge", {"occurrence": True}),
        ("shelve", {"reason": "Tests", "until": "soon"}),
        ("shelve", {"reason": "Tests", "until": "2026-05-04T14:00:00"}),
    ],
)
def test_missing_or_malformed_field_is_a_request_error(
    panel: Panel, act: str, values: dict[str, Any]
) -> None:
    with pytest.raises(InputError):
        panel.act(act, "a1", **values)
    assert panel.cell.status().state is State.UNACKNOWLEDGED


def test_the_same_id_of_another_client_is_not_the_same_act(panel: Panel) -> None:
    panel.act("acknowledge", "a1", occurrence=1)
    request = ActRequest("acknowledge", BOB, "air", {"occurrence": 1})
    assert asyncio.run(panel.runner.act(request, "a1")).code == "press_id_reused"

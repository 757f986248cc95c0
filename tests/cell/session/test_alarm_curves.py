"""The curve around the raise of an alarm: read from the history, and kept after it."""

import asyncio
import math
from pathlib import Path

import pytest

from app.cell.alarms.states import Moment
from app.cell.robot.history import FieldHistory, History
from app.cell.session import alarm_curves
from app.cell.session.alarm_curves import AlarmCurves
from tests.cell.alarms.test_engine import Cell
from tests.cell.alarms.test_first_out import AIR


class Curves(Cell):
    """A cell whose samples are in the history."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder, AIR % ("air", "air", "Air", '"Air"'))
        self.robot.history = History(self.now, self.now)
        self.field = FieldHistory(120.0, math.inf)
        self.robot.history.fields[self.robot.key("/air"), "data"] = self.field
        self.curves = AlarmCurves(self.engine.robots, lambda: Moment(self.now, self.now))

    def measure(self, *values: float) -> None:
        """Publishes a value each second."""
        for value in values:
            self.publish(value)
            self.field.add(self.robot.history.time(self.now), value)
            self.now += 1.0

    @property
    def shown(self) -> list[float] | None:
        curve = self.curves.of_alarm(self.engine.alarms["air"])
        return curve and [column.last for column in curve.columns]


@pytest.fixture
def cell(tmp_path: Path) -> Curves:
    return Curves(tmp_path)


def test_the_curve_is_around_the_raise_as_far_as_it_is_there(cell: Curves) -> None:
    assert cell.shown is None
    cell.measure(*([6.0] * 20), 4.0, 3.9)
    assert cell.shown == [*([6.0] * 8), 4.0, 3.9]
    cell.measure(*([3.8] * 10))
    assert cell.shown == [*([6.0] * 8), 4.0, 3.9, *([3.8] * 4)]
    cell.now += 200.0
    assert cell.shown is None


def test_it_is_kept_for_the_occurrence_and_the_newest_raises(
    cell: Curves, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(alarm_curves, "DECODED_S", -alarm_curves.AFTER_S)
    alarm = cell.engine.alarms["air"]

    async def planned() -> None:
        cell.curves.plan(alarm)
        while cell.curves._planned:
            await asyncio.sleep(0)

    cell.measure(6.0, 4.0, *([3.0] * 8))
    asyncio.run(planned())
    kept = cell.shown
    assert kept == [6.0, 4.0, *([3.0] * 5)]
    cell.now += 600.0
    assert cell.shown == kept
    cell.measure(6.0, 4.5)
    assert cell.shown == [3.0, 6.0, 4.5]  # the line comes in from the last value before
    monkeypatch.setattr(alarm_curves, "MAX_PLANNED", 0)
    cell.curves.plan(alarm)
    assert not cell.curves._planned

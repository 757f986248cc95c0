"""What a robot says of an alarm that stands is shown without a change of its state."""

import asyncio
import time
from pathlib import Path

from app.cell.alarms.published import AlarmEntry
from app.cell.alarms.shown import AlarmRow
from app.cell.session.alarms import Alarms
from app.panel import load_panel
from app.records import NullLog
from tests.cell.alarms.test_engine import HEALTH, PANEL
from tests.support.builders import robot_there
from tests.support.waiting import when

ALARM = "health:motor 7"


def entry(details: str, level: int = 1) -> AlarmEntry:
    return AlarmEntry("motor 7", level, "Hot", (3, 2), details=details)


def test_the_values_of_a_standing_diagnostic_stay_new(tmp_path: Path) -> None:
    (tmp_path / "cell.toml").write_text(PANEL + HEALTH + "[alarms]\npanel = false\n")
    panel = load_panel(tmp_path / "cell.toml")

    async def work() -> tuple[AlarmRow, int]:
        alarms = Alarms(panel)
        robot = alarms.add_robot("", robot_there(panel))

        def hotter() -> bool:
            robot.entries_received("health", [entry("temperature: 95")], time.monotonic(), True, ())
            return bool(alarms.view()["rows"][ALARM]["details"] == "temperature: 95")

        await alarms.start(tmp_path / "data", NullLog())
        try:
            robot.entries_received("health", [entry("temperature: 80")], time.monotonic(), True, ())
            await when(lambda: ALARM in alarms.view()["rows"])
            assert alarms.view()["rows"][ALARM]["details"] == "temperature: 80"
            await when(hotter)
            return alarms.view()["rows"][ALARM], alarms.counts.raised.total()
        finally:
            await alarms.stop()

    row, raised = asyncio.run(work())
    assert (row["occurrence"], row["acknowledged"], raised) == (1, False, 1)

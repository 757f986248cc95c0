"""What a robot says of an alarm that stands is shown without a change of its state."""

import asyncio
import time
from pathlib import Path

from app.alarms.entries import AlarmEntry
from app.alarms.rows import AlarmRow
from app.audit import NullLog
from app.panel import load_panel
from app.runtime.alarms import Alarms
from tests.alarms.test_engine import HEALTH, PANEL
from tests.support.builders import robot_there

ALARM = "health:motor 7"


def entry(details: str, level: int = 1) -> AlarmEntry:
    return AlarmEntry("motor 7", level, "Hot", (3, 2), details=details)


def test_the_values_of_a_standing_diagnostic_stay_new(tmp_path: Path) -> None:
    (tmp_path / "cell.toml").write_text(PANEL + HEALTH + "[alarms]\npanel = false\n")
    panel = load_panel(tmp_path / "cell.toml")

    async def work() -> tuple[AlarmRow, int]:
        alarms = Alarms(panel)
        robot = alarms.add_robot("", robot_there(panel))
        await alarms.start(tmp_path / "data", NullLog())
        try:
            robot.entries_received("health", [entry("temperature: 80")], time.monotonic(), True, ())
            async with asyncio.timeout(20):
                while ALARM not in alarms.view()["rows"]:
                    await asyncio.sleep(0.02)
                assert alarms.view()["rows"][ALARM]["details"] == "temperature: 80"
                while alarms.view()["rows"][ALARM]["details"] != "temperature: 95":
                    robot.entries_received(
                        "health", [entry("temperature: 95")], time.monotonic(), True, ()
                    )
                    await asyncio.sleep(0.1)
            return alarms.view()["rows"][ALARM], alarms.counts.raised.total()
        finally:
            await alarms.stop()

    row, raised = asyncio.run(work())
    assert (row["occurrence"], row["acknowledged"], raised) == (1, False, 1)

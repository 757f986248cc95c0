"""First-out: the first alarm of a group that is raised is named by those that follow it."""

from functools import partial
from pathlib import Path

import pytest

from app.cell.alarms.engine import Restored
from app.cell.alarms.records import leader_in, record_of
from app.cell.alarms.shown import row_of
from app.cell.alarms.states import Moment
from tests.cell.alarms.test_engine import Cell
from tests.support.words import english

AIR = """
[[alarm]]
id = "%s"
topic = "/%s"
type = "std_msgs/msg/Float64"
text = "%s"
low = 5.0
group = %s
"""
GROUPS = "".join(
    AIR % (name, name, name.title(), '{ en = "Air", ja = "空気" }' if name != "oil" else '"Oil"')
    for name in ("air", "pump", "valve", "oil")
)


@pytest.fixture
def cell(tmp_path: Path) -> partial[Cell]:
    return partial(Cell, tmp_path)


def follows(cell: Cell, alarm: str) -> str:
    return row_of(cell.engine.alarms[alarm], Moment(cell.now, cell.now))["follows"]


def raised(cell: Cell, *alarms: str, after_s: float = 0.5) -> None:
    for alarm in alarms:
        cell.publish(4.0, f"/{alarm}")
        cell.now += after_s


def test_alarms_within_the_time_follow_the_first_of_their_group(cell: partial[Cell]) -> None:
    air = cell(GROUPS)
    raised(air, "pump", "oil", "air", "valve")
    assert [follows(air, name) for name in ("pump", "oil", "air", "valve")] == ["", "", "pump", "pump"]
    row = row_of(air.engine.alarms["valve"], Moment(air.now, air.now))
    assert english(row["follows_text"]) == "1.5 s after Pump"


def test_an_alarm_after_the_time_is_the_first_of_its_own_burst(cell: partial[Cell]) -> None:
    air = cell(GROUPS)
    raised(air, "pump", after_s=2.1)
    raised(air, "air", "valve")
    assert (follows(air, "air"), follows(air, "valve")) == ("", "air")


def test_the_time_is_that_of_the_panel_file(cell: partial[Cell]) -> None:
    air = cell("[alarms]\nfirst_out_s = 60.0\n" + GROUPS)
    raised(air, "pump", after_s=50.0)
    raised(air, "air")
    assert follows(air, "air") == "pump"


def test_an_alarm_does_not_follow_one_that_is_over(cell: partial[Cell]) -> None:
    air = cell(GROUPS)
    raised(air, "pump")
    air.acknowledge("pump", 1)
    air.publish(6.0, "/pump")
    assert air.status("pump").is_normal
    raised(air, "air")
    assert follows(air, "air") == ""


def test_an_alarm_that_comes_again_does_not_follow_itself(cell: partial[Cell]) -> None:
    air = cell(GROUPS)
    raised(air, "pump", "air", after_s=0.2)
    air.publish(6.0, "/pump")
    raised(air, "pump")
    assert (follows(air, "pump"), follows(air, "air")) == ("", "pump")


def test_alarms_without_a_group_follow_none(cell: partial[Cell]) -> None:
    air = cell("".join(AIR.replace("group = %s\n", "") % (name, name, name) for name in ("a", "b")))
    raised(air, "a", "b")
    assert (follows(air, "a"), follows(air, "b")) == ("", "")


def test_what_an_alarm_follows_is_kept_over_a_restart(cell: partial[Cell]) -> None:
    before = cell(GROUPS)
    raised(before, "pump", "air")
    now = Moment(before.now, before.now)
    records = {name: record_of(before.engine.alarms[name], now) for name in ("pump", "air")}
    assert leader_in(records["pump"]) is None
    after = cell(GROUPS)
    assert after.engine.restore(records) == Restored()
    assert follows(after, "air") == "pump"

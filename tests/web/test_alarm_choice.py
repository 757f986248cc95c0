"""Which alarms the page lists, and their order."""

from typing import Any, cast

from app.cell.alarms.shown import AlarmRow
from app.web.pages.alarms import AlarmChoice, shows


def row(name: str, **more: Any) -> AlarmRow:
    """An active alarm that is not acknowledged."""
    values = {"id": name, "priority": 3, "group": "Air", "robot": "", "state": "active"}
    order = [int(more.get("state") == "shelved"), 0, more.get("priority", 3), more.pop("raised", 0)]
    return cast(AlarmRow, {"acknowledged": False, "order": order, **values, **more})


ROWS = [
    row("door", priority=1, group="Guard", raised=-10),
    row("ribbon", group="Printer", raised=-30),
    row("air", priority=2, raised=-20),
    row("filter", state="shelved", raised=-40),
]


def names(choice: AlarmChoice) -> list[str]:
    taken = [row for row in ROWS if choice.takes(row) and shows(choice.show, row)]
    return [row["id"] for row in choice.sorted(taken, "en")]


def test_orders() -> None:
    assert names(AlarmChoice()) == ["door", "ribbon", "air", "filter"]
    assert names(AlarmChoice(sort="newest")) == ["filter", "ribbon", "air", "door"]
    assert names(AlarmChoice(sort="priority")) == ["door", "air", "filter", "ribbon"]
    assert names(AlarmChoice(sort="group")) == ["air", "filter", "door", "ribbon"]


def test_filters() -> None:
    assert names(AlarmChoice(group="Air")) == ["air", "filter"]
    assert names(AlarmChoice(priority=3, show="unacknowledged")) == ["ribbon"]
    assert names(AlarmChoice(show="shelved")) == ["filter"]
    assert names(AlarmChoice(robot="left")) == []


def test_an_address_has_what_is_not_the_default() -> None:
    choice = AlarmChoice("shelved", 2, "Air & water", sort="newest", alarm="air@1")
    assert choice.address() == "show=shelved&priority=2&group=Air+%26+water&sort=newest&alarm=air%401"
    assert choice.address(alarm="", show="all", group="") == "priority=2&sort=newest"
    assert AlarmChoice().address() == ""

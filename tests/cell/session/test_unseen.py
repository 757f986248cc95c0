"""What no client looks at: displays are not built, and their topics wake nobody; what is judged or
recorded sees every sample as before."""

import asyncio
import math
import time
from collections.abc import Callable
from typing import Any, Final

import pytest

from app.cell.view import kinds
from app.panel.model import Panel
from tests.cell.session.test_turn import Cell, Stamp
from tests.support.builders import FREE, GUARDED, HEARD, INTERFACES, TEXT, panel_of
from tests.support.waiting import when

FLOAT: Final = "std_msgs/msg/Float64"
LEVEL: Final = {"id": "level", "kind": "readout", "label": "Level", "topic": "/level", "type": FLOAT}
OF_LEVEL: Final = {"topic": "/level", "type": FLOAT}
AGED: Final = {**HEARD, "id": "aged", "topic": "/aged", "max_age_s": 0.05}


def two_pages(*widgets: Any, **more: Any) -> Panel:
    """Displays on the second page, nothing but commands on the first."""
    pages = [("one", [FREE, GUARDED]), ("two", list(widgets))]
    page = [{"id": name, "title": name.title(), "widget": shown} for name, shown in pages]
    return panel_of(page=page, **more)


def cell_of(monkeypatch: pytest.MonkeyPatch, panel: Panel) -> Cell:
    cell = Cell(monkeypatch, panel)
    cell.session.publisher.on_watched = cell.session.watch
    cell.session.watch()
    return cell


def text_of(cell: Cell, widget: str) -> Any:
    return cell.session.publisher.view["widgets"][widget]["text"]


def say(cell: Cell, topic: str, text: str) -> None:
    cell.inbox.put(topic, INTERFACES.encode(TEXT, {"data": text}), Stamp())


def test_displays_are_built_for_pages_that_a_client_sees(monkeypatch: pytest.MonkeyPatch) -> None:
    async def scene() -> None:
        cell = cell_of(monkeypatch, two_pages(HEARD))
        publisher, built = cell.session.publisher, counted(monkeypatch)
        with publisher.watching("one"):
            for number in range(20):
                say(cell, "heard", str(number))
                cell.permit(number % 2 == 0)
                cell.take()
            assert built.count("heard") == 0
            assert built.count("guarded") > 15
            assert text_of(cell, "heard") == "—"
            with publisher.watching("two"):
                assert text_of(cell, "heard") == "19"
                say(cell, "heard", "seen")
                cell.take()
                await when(lambda: text_of(cell, "heard") == "seen")
            say(cell, "heard", "unseen")
            cell.permit(True)
            cell.take()
            assert text_of(cell, "heard") == "seen"
            with publisher.watching(""):
                assert text_of(cell, "heard") == "unseen"
        await cell.session.stop()

    asyncio.run(scene())


def counted(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The ids of the widgets whose attributes are made from now on."""
    ids: list[str] = []
    real: Callable[..., Any] = kinds.attributes_of

    def note(widget: Any, *arguments: Any) -> Any:
        ids.append(widget.id)
        return real(widget, *arguments)

    monkeypatch.setattr("app.cell.view.view.attributes_of", note)
    return ids


def test_what_time_changes_is_right_as_soon_as_a_client_sees_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async def scene() -> None:
        cell = cell_of(monkeypatch, two_pages(AGED))
        with cell.session.publisher.watching("two"):
            say(cell, "aged", "now")
            cell.take()
            await when(lambda: text_of(cell, "aged") == "now")
        began = time.monotonic()
        await when(lambda: time.monotonic() - began > 0.05)
        with cell.session.publisher.watching("two"):
            assert cell.session.publisher.view["widgets"]["aged"]["state"] == "old"
        await cell.session.stop()

    asyncio.run(scene())


def test_what_nobody_looks_at_is_taken_once_a_second(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.cell.session.turn.IDLE_S", 0.01)

    async def scene() -> None:
        cell = cell_of(monkeypatch, two_pages(HEARD))
        topics = cell.session.robot.traffic.topics
        for number in range(5):
            say(cell, "heard", str(number))
        await when(lambda: "heard" in topics and topics["heard"].count == 5)
        assert text_of(cell, "heard") == "—"
        await cell.session.stop()

    asyncio.run(scene())


RAISED: Final = {"id": "low", **OF_LEVEL, "text": "Low", "priority": 2}
FULL: Final = {"id": "full", **OF_LEVEL, "min": 1.0}
LISTED: Final = {"id": "list", "kind": "conditions", "label": "Ready", "conditions": ["full"]}
CONFIRMED: Final = {**FREE, "id": "c", "confirm": {**OF_LEVEL, "equals": 1.0}}
PEN: Final = {**OF_LEVEL, "label": "Level"}
TREND: Final = {"id": "t", "kind": "trend", "label": "T", "window": "1m", "pen": [PEN]}
STEP: Final = {
    "id": "s",
    "kind": "step",
    "label": "S",
    "topic": "/set",
    "type": FLOAT,
    "message": {"data": "{value}"},
    **{"min": 0.0, "max": 9.0, "step": 1.0, "value": OF_LEVEL},
}
COUNTS: Final[dict[str, tuple[list[Any], dict[str, Any]]]] = {
    "an interlock": ([], {"further": [FULL]}),
    "a condition": ([LISTED], {"condition": [{**FULL, "label": "Full"}]}),
    "an alarm's limit": ([], {"alarm": [{**RAISED, "low": 1.0}]}),
    "an alarm's age": ([], {"alarm": [{**RAISED, "stale_s": 1.0}]}),
    "a suppression": (
        [],
        {"alarm": [{**RAISED, "topic": "/other", "low": 1.0, "while": {**OF_LEVEL, "max": 1.0}}]},
    ),
    "a confirmation": ([CONFIRMED], {}),
    "a trend": ([TREND], {}),
    "a button's value": ([STEP], {}),
}


@pytest.mark.parametrize("by", [*COUNTS])
def test_a_topic_by_which_something_is_judged_or_recorded_is_no_idle_one(
    monkeypatch: pytest.MonkeyPatch, by: str
) -> None:
    widgets, more = COUNTS[by]

    async def scene() -> None:
        cell = cell_of(monkeypatch, two_pages(LEVEL, *widgets, **more))
        cell.inbox.put("level", INTERFACES.encode(FLOAT, {"data": math.pi}), Stamp())
        assert not cell.inbox.has_idle
        alone = cell_of(monkeypatch, two_pages(LEVEL))
        alone.inbox.put("level", INTERFACES.encode(FLOAT, {"data": math.pi}), Stamp())
        assert alone.inbox.has_idle
        await alone.session.stop()
        await cell.session.stop()

    asyncio.run(scene())

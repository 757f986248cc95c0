"""One turn of a session: robot's state, holds, confirmations, view, in this order."""

import asyncio
import time
from collections.abc import Coroutine
from datetime import UTC, datetime
from typing import Any

import pytest

from app.cell.commands.confirmations import Confirmations
from app.cell.commands.holds import ActiveHold, HoldController
from app.cell.commands.receipts import Receipt
from app.cell.link.bridge import BRIDGE as BRIDGES
from app.cell.link.peer import RobotAccess
from app.cell.permission.control import LIFE_S
from app.cell.session.session import ServerParts, wire_session
from app.cell.view import refresh
from app.panel.model import Panel
from app.records import Entry, NullLog
from app.records.principal import Clients, Principal
from app.ros.dialects import bridge_dialect
from app.ros.zenoh.config import config_to
from app.ros.zenoh.inbox import Inbox
from tests.cell.commands.test_holds import ARM, HALF, JOG, SPEED
from tests.cell.session.test_another_dialect import TinyPeer
from tests.support.builders import (
    BOOL,
    BRIDGE,
    FREE,
    HEARD,
    INTERFACES,
    MESSAGE,
    TEXT,
    panel_of,
    press_of,
    press_widget,
)
from tests.support.waiting import when

SAMPLES = 5_000
CONFIRM = {"topic": "/heard", "field": "data", "equals": "{message}", "within_s": 0.5}
PANEL = panel_of(SPEED, JOG, ARM, MESSAGE, {**FREE, "confirm": CONFIRM}, HEARD)
ACCESS = RobotAccess(BRIDGES.dialect, BRIDGES.traits, TinyPeer, BRIDGES.observe)
CONTROLLED = panel_of(SPEED, JOG, ARM, control={"required": True})
ANN = Principal(Clients().identify(f"{1:032x}", "192.0.2.1"))


class Stamp:
    """Of the bridge, which stamps all that comes through it."""

    def get_id(self) -> str:
        return BRIDGE

    def get_time(self) -> Any:
        return datetime.now(UTC)


class Cell:
    """A session without Zenoh: what arrives is put into its inbox, what it sends is kept."""

    def __init__(
        self, monkeypatch: pytest.MonkeyPatch, panel: Panel = PANEL, log: NullLog | None = None
    ) -> None:
        self.ended: list[Receipt] = []
        self.order: list[str] = []
        self._monkeypatch = monkeypatch
        server = ServerParts(panel, "r1", log or NullLog())
        self.session = wire_session(server, config_to("tcp/127.0.0.1:1"), ACCESS)
        self.inbox: Inbox = self.session.link._inbox
        ingest = self.session.ingest
        self.inbox.set_topics(ingest.immediate, ingest.lossless, ingest.recorded)
        monkeypatch.setattr(self.session.link, "put", lambda *_: None)
        monkeypatch.setattr(self.session.link, "has_reader", lambda _: True)
        monkeypatch.setattr(self.session.link, "declare_tokens", lambda _: None)
        self.inbox.transport(BRIDGE, True)
        self.inbox.token(bridge_dialect.bridge_token(BRIDGE), True)
        self.permit(True)
        self.take()

    def permit(self, permitted: bool) -> None:
        self.inbox.put("operation_enabled", INTERFACES.encode(BOOL, {"data": permitted}), Stamp())

    def take(self) -> None:
        self.session.turn.run()

    def hold(self, widget: str) -> None:
        inputs = HALF if widget == "jog" else {}
        hold = self.session.holds.begin(
            press_of(self.session.holds.widget(widget), inputs), time.monotonic(), self.ended.append
        )
        assert isinstance(hold, ActiveHold)

    def note_the_order(self) -> None:
        """Notes in which order things are judged and shown from now on."""

        def noted(owner: Any, name: str, event: str) -> None:
            real = getattr(owner, name)

            def note(*args: Any, **named: Any) -> Any:
                self.order.append(event)
                return real(*args, **named)

            self._monkeypatch.setattr(owner, name, note)

        noted(HoldController, "judge", "holds")
        noted(Confirmations, "update", "confirmations")
        noted(refresh, "build_view", "view")


def run(work: Coroutine[Any, Any, None]) -> None:
    asyncio.run(work)


def test_a_view_that_can_not_be_built_keeps_no_hold_from_its_end(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(refresh, "AGAIN_S", 0.01)

    async def scene() -> None:
        cell = Cell(monkeypatch)
        assert cell.session.publisher.view["widgets"]["jog"]["enabled"]
        cell.hold("jog")
        cell.hold("arm")
        with monkeypatch.context() as broken:
            broken.setattr(refresh, "build_view", Broken())
            cell.permit(False)
            cell.take()
            assert [receipt.widget for receipt in cell.ended] == ["jog", "arm"]
            shown = cell.session.publisher.view
            assert (
                codes(shown["widgets"]["jog"])
                == codes(shown["widgets"]["free"])
                == (False, "view_failed")
            )
            assert (await press_widget(cell.session.presses, "free", {"message": "x"}, "p")).outcome
        await when(
            lambda: codes(cell.session.publisher.view["widgets"]["jog"]) != (False, "view_failed")
        )
        await cell.session.stop()

    run(scene())
    assert caplog.text.count("the view could not be refreshed") == 1


def codes(attributes: Any) -> tuple[bool, str]:
    return attributes["enabled"], attributes["reason"].code


class Broken:
    def __call__(self, *_: Any, **__: Any) -> Any:
        raise RuntimeError("no view")


def test_in_a_turn_with_thousands_of_samples_holds_are_judged_before_anything_is_shown(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async def scene() -> None:
        cell = Cell(monkeypatch)
        cell.hold("jog")
        cell.note_the_order()
        for number in range(SAMPLES):
            cell.inbox.put(f"other{number}", b"", None)
        cell.permit(False)
        cell.take()
        assert [receipt.widget for receipt in cell.ended] == ["jog"]
        assert (cell.order[0], cell.order[-1]) == ("holds", "view")
        assert cell.order.count("view") == 1
        await cell.session.stop()

    run(scene())


def test_a_false_that_came_and_went_in_a_flood_ends_a_hold(monkeypatch: pytest.MonkeyPatch) -> None:
    async def scene() -> None:
        cell = Cell(monkeypatch)
        cell.hold("jog")
        for number in range(SAMPLES):
            cell.permit(number != SAMPLES - 100)
        cell.take()
        assert [receipt.widget for receipt in cell.ended] == ["jog"]
        assert cell.session.publisher.view["widgets"]["jog"]["enabled"]
        await cell.session.stop()

    run(scene())


def test_a_turn_judges_holds_then_confirmations_and_shows_last(monkeypatch: pytest.MonkeyPatch) -> None:
    async def scene() -> None:
        cell = Cell(monkeypatch)
        press = asyncio.ensure_future(
            press_widget(cell.session.presses, "free", {"message": "on"}, "p")
        )
        await when(lambda: cell.session.commands.confirmations.is_awaited("heard"))
        cell.note_the_order()
        cell.inbox.put("heard", INTERFACES.encode(TEXT, {"data": "on"}), Stamp())
        cell.permit(False)
        cell.take()
        assert cell.order == ["holds", "confirmations", "view"]
        assert (await press).outcome == "confirmed"
        await cell.session.stop()

    run(scene())


def test_change_during_a_turn_is_shown_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """As when a hold ends: it reports so, and the turn that ended it shows it."""

    async def scene() -> None:
        cell = Cell(monkeypatch)
        cell.hold("jog")
        cell.hold("arm")
        version = cell.session.publisher.version
        cell.permit(False)
        cell.take()
        assert cell.session.publisher.version == version + 1
        assert not cell.session.publisher.view["widgets"]["jog"]["held"]
        await cell.session.stop()

    run(scene())


class Entries(NullLog):
    def __init__(self) -> None:
        super().__init__()
        self.actions: list[str] = []

    def add(self, entry: Entry) -> None:
        self.actions.append(entry.action)


def test_lost_control_is_recorded_by_a_turn_though_no_data_arrives(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async def scene() -> None:
        entries = Entries()
        cell = Cell(monkeypatch, CONTROLLED, entries)
        session, control = cell.session, cell.session.control
        assert control.take(ANN, life_s=0.05) == ""
        cell.take()
        await when(lambda: not (session.publisher.view["control"]["holder"] or not entries.actions))
        assert entries.actions == ["control_lost"]
        await session.stop()

    run(scene())


def test_a_view_that_is_built_after_an_expiry_writes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    async def scene() -> None:
        entries = Entries()
        cell = Cell(monkeypatch, CONTROLLED, entries)
        session, control = cell.session, cell.session.control
        control.take(ANN)
        now = time.monotonic() + LIFE_S
        monkeypatch.setattr(control, "_now", lambda: now)
        session.refresher.refresh_now()
        assert session.publisher.view["control"]["holder"] == ""
        assert entries.actions == []
        cell.take()
        cell.take()
        assert entries.actions == ["control_lost"]
        await session.stop()

    run(scene())

"""A session is wired whole: each signal has a receiver before anything can be emitted."""

import asyncio

import pytest

from app.cell.link.peer import Signal
from app.cell.link.robot_access import ROBOT_ACCESS
from app.cell.session import session as robot_session
from app.cell.session.fleet import Fleet
from app.cell.session.session import RobotSession, ServerParts, wire_session
from app.records import NullLog
from app.ros.zenoh.config import config_to
from tests.support.builders import small_panel
from tests.support.waiting import when

NOWHERE = "tcp/127.0.0.1:1"


def wired() -> RobotSession:
    """A session that has not been started."""
    panel = small_panel()
    server = ServerParts(panel, "r1", NullLog())
    return wire_session(server, config_to(NOWHERE), ROBOT_ACCESS[panel.dialect])


def test_receivers_are_called_in_the_order_in_which_they_were_connected() -> None:
    called: list[tuple[str, int]] = []
    signal = Signal[[int]]()
    signal.emit(1)
    signal.connect(lambda number: called.append(("first", number)))
    signal.connect(lambda number: called.append(("second", number)))
    signal.emit(2)
    assert called == [("first", 2), ("second", 2)]


def test_each_signal_of_a_session_has_a_receiver() -> None:
    async def scene() -> None:
        signals = vars(wired().context.signals)
        assert signals
        unheard = {name for name, signal in signals.items() if not signal._receivers}
        # By the journal of changes and the recorder, which this panel has not.
        assert unheard == {"stepped", "stopped"}

    asyncio.run(scene())


def test_a_lost_link_locks_everything_and_is_renewed() -> None:
    """By signals alone: the graph is dropped, a new Zenoh session is opened."""

    async def scene() -> None:
        session = wired()
        renewed: list[bool] = []
        vars(session.link)["renew"] = lambda: renewed.append(True)
        session.robot.link_up, session.robot.settled_at = True, 0.0
        session.context.signals.link_lost.emit()
        assert session.link_verdict.code == "link_unreachable"
        await when(lambda: renewed)
        await session.renewal.stop()
        assert renewed == [True]

    asyncio.run(asyncio.wait_for(scene(), 20))


def test_a_server_that_has_just_started_says_so_and_later_what_is_missing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """That a robot is not joined yet is not a fault. The page changes by itself."""
    monkeypatch.setattr(robot_session, "STARTING_S", 0.2)

    async def scene() -> None:
        fleet = Fleet(small_panel(), lambda _: config_to(NOWHERE), "r1", NullLog())
        await fleet.start()
        try:
            session = fleet.first
            assert session.link_verdict.code == "link_starting"
            await when(lambda: session.publisher.view["link"]["bridge"]["state"] == "wait")
            await when(lambda: session.publisher.view["link"]["bridge"]["state"] == "bad")
            assert session.link_verdict.code == "link_unreachable"
        finally:
            await fleet.stop()

    asyncio.run(asyncio.wait_for(scene(), 20))

"""What comes on rmw_zenoh with an attachment that is not whole is not read, whatever it says."""

import asyncio
import struct
from collections.abc import Iterator
from contextlib import ExitStack, closing
from functools import partial
from typing import Any, Final

import pytest
import zenoh
from zenoh.ext import CacheConfig, declare_advanced_publisher
from zenoh.handlers import Callback

from app.ros.dialects.bridge_dialect import BridgeDialect
from app.ros.dialects.rmw_zenoh import RmwZenohDialect, attachment
from app.ros.zenoh.config import config_to
from app.ros.zenoh.declarations import Declarations
from app.ros.zenoh.session import NOT_READ, ZenohSession
from tests.cell.session.test_rmw_zenoh import LATCHED, asked, enabled, panel, reason, session_with
from tests.support.builders import BOOL, ENABLED, INTERFACES, TEXT, press_widget
from tests.support.parts import until
from tests.support.rmw import RmwNode, Router
from tests.support.waiting import when

GID: Final = bytes(range(16))
WHOLE: Final = attachment(7, 1_700_000_000_000_000_000, GID)
TRUE: Final = INTERFACES.encode(BOOL, {"data": True})
BROKEN: Final = {
    "none": None,
    "empty": b"",
    "one byte": WHOLE[:1],
    "the number alone": WHOLE[:8],
    "without the gid": WHOLE[:16],
    "a byte short": WHOLE[:-1],
    "a byte long": WHOLE + b"\x00",
    "another length": WHOLE[:16] + b"\x11" + WHOLE[17:],
    "a negative number": struct.pack("<qqB16s", -1, 1, 16, GID),
    "a negative time": struct.pack("<qqB16s", 1, -1, 16, GID),
    "a text": b"x" * 33,
}


class WithoutRouter(RmwZenohDialect):
    """For a link to one peer."""

    @property
    def as_client(self) -> bool:
        return False


@pytest.mark.parametrize("kind", BROKEN)
def test_a_dialect_with_attachments_accepts_whole_ones_only(kind: str) -> None:
    assert RmwZenohDialect().accepts(WHOLE)
    assert not RmwZenohDialect().accepts(BROKEN[kind])
    assert BridgeDialect().accepts(BROKEN[kind])  # a bridge sends none


@pytest.fixture
def link(peer: tuple[str, zenoh.Session]) -> Iterator[ZenohSession]:
    with closing(ZenohSession(config_to(peer[0]), lambda _: None, WithoutRouter())) as mine:
        mine.start(Declarations(subscribe={"a": "a", "late": "late"}, publish={}, query={"q": "q"}))
        yield mine


def received(link: ZenohSession, key: str, wanted: bytes) -> bool:
    sample = link.drain().samples.get(key)
    return sample is not None and bytes(sample.payload) == wanted


@pytest.mark.parametrize("kind", BROKEN)
def test_each_way_of_a_message_reads_whole_ones_only(
    peer: tuple[str, zenoh.Session], link: ZenohSession, kind: str
) -> None:
    _, session = peer
    on_demand: list[bytes] = []
    link.subscribe_on_demand("d", "d", lambda payload: on_demand.append(bytes(payload)))
    with ExitStack() as stack:
        publishers: list[Any] = [session.declare_publisher(key) for key in ("a", "d")]
        for publisher in publishers:
            stack.callback(publisher.undeclare)
            until(
                partial(lambda publisher: publisher.matching_status.matching, publisher), "it is read"
            )
        for whole, read in ((WHOLE, TRUE), (BROKEN[kind], NOT_READ)):
            for publisher in publishers:
                publisher.put(TRUE, attachment=whole)
            until(partial(received, link, "a", read), f"the topic has {read!r}")
            until(partial(lambda last: on_demand[-1:] == [last], read), f"{read!r} was sent")
        cached = declare_advanced_publisher(
            session, "late", cache=CacheConfig(max_samples=1), publisher_detection=True
        )
        cached.put(TRUE, attachment=BROKEN[kind])
        stack.callback(cached.undeclare)
        until(partial(received, link, "late", NOT_READ), "the cache's message is not read")


@pytest.mark.parametrize("kind", BROKEN)
def test_a_response_is_read_with_a_whole_attachment_only(
    peer: tuple[str, zenoh.Session], link: ZenohSession, kind: str
) -> None:
    _, session = peer
    attached: bytes | None = WHOLE

    def respond(query: zenoh.Query) -> None:
        with query:
            query.reply("q", TRUE, attachment=attached)

    def answer() -> bytes | None:
        async def asking() -> bytes | None:
            return await link.query("q", TRUE, 5.0)

        return asyncio.run(asking())

    queryable = session.declare_queryable("q", Callback(respond, indirect=False), complete=True)
    until(lambda: answer() == TRUE, "it is served")
    attached = BROKEN[kind]
    assert answer() == NOT_READ
    queryable.undeclare()


@pytest.fixture
def robot(router: Router) -> Iterator[RmwNode]:
    """It permits, at first."""
    mine = RmwNode(router, "arm")
    mine.subscribe("/go", TEXT)
    mine.advertise(ENABLED, BOOL, **LATCHED)
    mine.publish(ENABLED, {"data": True})
    yield mine
    mine.end()


def test_true_with_a_broken_attachment_opens_nothing(router: Router, robot: RmwNode) -> None:
    async def scene() -> None:
        async with session_with(router, panel()) as session:
            for kind, broken in BROKEN.items():
                await when(partial(enabled, session), "the robot permits")
                instead = "" if broken is None else broken.hex()
                await asked(partial(robot.publish, ENABLED, {"data": True}, instead=instead))
                await when(lambda: not enabled(session), f"{kind} locks")
                assert reason(session).code == "interlock_unreadable"
                receipt = await press_widget(session.presses, "go", {"message": "x"}, kind)
                assert receipt.outcome == "refused"
                await asked(robot.publish, ENABLED, {"data": True})
            assert robot.heard("/go") == []

    asyncio.run(scene())

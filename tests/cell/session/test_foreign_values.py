"""The attack: a Zenoh session that is none of the robot's says that operation is permitted."""

import asyncio
import json
import time
from collections.abc import Iterator
from contextlib import closing
from functools import partial
from typing import Any

import pytest
import zenoh

from app.cell.session.session import RobotSession
from app.ros.dialects.rmw_zenoh import attachment
from tests.cell.session.test_rmw_zenoh import LATCHED, asked, enabled, panel, session_with
from tests.support.builders import BOOL, ENABLED, INTERFACES, TEXT, panel_of, press_widget
from tests.support.parts import until
from tests.support.rmw import RmwNode, Router
from tests.support.waiting import when

KEY = "0/operation_enabled/std_msgs::msg::dds_::Bool_/" + INTERFACES.type_hash(BOOL)
TRUE = INTERFACES.encode(BOOL, {"data": True})
STAMPS = {"its own stamp": True, "the router's": False}
PERMIT = {
    "id": "permit",
    "kind": "publish",
    "label": "Permit",
    "topic": ENABLED,
    "type": BOOL,
    "message": {"data": True},
}


@pytest.fixture
def robot(router: Router) -> Iterator[RmwNode]:
    """It forbids, once."""
    mine = RmwNode(router, "arm")
    mine.subscribe("/go", TEXT)
    mine.advertise(ENABLED, BOOL, **LATCHED)
    mine.publish(ENABLED, {"data": False})
    yield mine
    mine.end()


def stranger(endpoint: str, *, stamps: bool) -> zenoh.Session:
    config = zenoh.Config()
    for place, value in {
        "mode": "client",
        "connect/endpoints": [endpoint],
        "scouting/multicast/enabled": False,
        "timestamping/enabled": stamps,
    }.items():
        config.insert_json5(place, json.dumps(value))
    return zenoh.open(config)


def put_true(session: zenoh.Session, key: str) -> None:
    """As a node would, but without its token."""
    publisher: Any = session.declare_publisher(key)
    until(lambda: publisher.matching_status.matching, "it sees who reads the permission")
    publisher.put(TRUE, attachment=attachment(1, time.time_ns(), bytes(range(16))))


def lock(session: RobotSession) -> Any:
    code = session.publisher.view["widgets"]["go"]["reason"]
    return getattr(code, "code", code)


@pytest.mark.parametrize("stamps", STAMPS.values(), ids=STAMPS)
def test_a_session_without_a_token_permits_nothing(
    router: Router, robot: RmwNode, stamps: bool
) -> None:
    async def scene() -> None:
        async with session_with(router, panel()) as session:
            await when(lambda: lock(session) == "interlock_not_permitted", "the robot forbids")
            with closing(await asked(partial(stranger, router.endpoint, stamps=stamps))) as other:
                await asked(put_true, other, KEY)
                await when(lambda: lock(session) == "interlock_foreign", "it is named")
                receipt = await press_widget(session.presses, "go", {"message": "x"}, "forged")
                assert receipt.outcome == "refused"
            await asked(robot.publish, ENABLED, {"data": True})
            await when(partial(enabled, session), "the robot's own value counts")
            assert robot.heard("/go") == []

    asyncio.run(scene())


def test_another_panel_may_permit(router: Router, robot: RmwNode) -> None:
    """Its session has a token of the topic's publisher."""

    async def scene() -> None:
        other = panel_of(PERMIT, dialect="rmw_zenoh")
        async with session_with(router, panel()) as session, session_with(router, other) as permitting:
            await when(lambda: lock(session) == "interlock_not_permitted", "the robot forbids")
            await when(partial(enabled, permitting, "permit"), "the other panel is there")
            assert (await press_widget(permitting.presses, "permit", {}, "p")).outcome == "published"
            await when(partial(enabled, session), "it counts")

    asyncio.run(scene())

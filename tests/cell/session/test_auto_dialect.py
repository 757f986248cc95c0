"""A panel file that does not say how its robot is reached: what is there decides."""

import asyncio
from functools import partial

from app.cell.session.fleet import Fleet
from app.cell.session.session import RobotSession
from app.panel.model import Panel
from app.records import NullLog
from app.ros.dialects import bridge_dialect
from app.ros.zenoh.config import config_to
from app.system.texts import say
from app.tools.simulator.in_process import in_process
from tests.cell.session.test_rmw_zenoh import (
    CALL,
    GO,
    LATCHED,
    asked,
    enabled,
    has_heard,
    link,
    session_with,
)
from tests.support.builders import BOOL, ENABLED, HEARD, MESSAGE, TEXT, panel_of, press_widget
from tests.support.rmw import RmwNode, Router
from tests.support.waiting import when

PANEL = panel_of(MESSAGE, GO, HEARD, CALL)


def node_that_permits(router: Router) -> RmwNode:
    node = RmwNode(router, "arm")
    node.subscribe("/go", TEXT)
    node.advertise(ENABLED, BOOL, **LATCHED)
    node.publish(ENABLED, {"data": True})
    return node


async def presses(session: RobotSession, robot: RmwNode, number: int) -> None:
    receipt = await press_widget(session.presses, "go", {"message": str(number)}, f"n{number}")
    assert receipt.outcome == "published", receipt.reason
    await when(partial(has_heard, robot, number), "heard")


def test_nodes_that_are_there_or_come_later_are_the_robot(router: Router) -> None:
    async def scene() -> None:
        async with session_with(router, PANEL) as session:
            await when(lambda: session.link_verdict.code == "link_no_peer")
            assert link(session, "bridge")["name"] == say("bridge")
            robot = await asked(node_that_permits, router)
            try:
                await when(partial(enabled, session), "nodes were found")
                assert link(session, "bridge")["name"] == say("router")
                await presses(session, robot, 1)
                assert "/web_ui" in await asked(robot.nodes)
                await asked(router.kill)
                await when(lambda: not session.robot.link_up, "the link is lost")
                await asked(router.start)
                await when(partial(enabled, session), "found again")
                await presses(session, robot, 2)
            finally:
                await asked(robot.end)

    asyncio.run(scene())


def test_a_bridge_that_is_there_is_the_robots() -> None:
    async def scene(panel: Panel, endpoint: str) -> None:
        fleet = Fleet(panel, lambda _: config_to(endpoint), "r1", NullLog())
        session = fleet.first
        await session.start()
        try:
            await when(lambda: session.link_verdict.permitted)
            assert link(session, "bridge")["name"] == say("bridge")
            assert session.link_verdict.code == "permitted"
        finally:
            await fleet.stop()

    panel = panel_of(MESSAGE, GO, HEARD, CALL, mode="demo")
    with in_process(panel) as endpoint:
        asyncio.run(scene(panel, endpoint))


def test_both_at_once_lock_until_one_of_them_is_gone(router: Router) -> None:
    async def scene() -> None:
        bridge = await asked(RmwNode, router, "tool")  # its session holds a bridge's token too
        robot = None
        try:
            await asked(bridge.hold, bridge_dialect.bridge_token("b1"))
            robot = await asked(node_that_permits, router)
            async with session_with(router, PANEL) as session:
                await when(lambda: session.link_verdict.code == "link_two_kinds", "both are seen")
                assert not enabled(session)
                assert (
                    await press_widget(session.presses, "go", {"message": "x"})
                ).outcome == "refused"
                await asked(bridge.end)
                await when(partial(enabled, session), "only nodes are left")
                await presses(session, robot, 1)
            said = panel_of(MESSAGE, GO, HEARD, CALL, dialect="rmw_zenoh")
            other = await asked(RmwNode, router, "tool")
            try:
                await asked(other.hold, bridge_dialect.bridge_token("b1"))
                async with session_with(router, said) as session:
                    await when(partial(enabled, session), "the file says which")
            finally:
                await asked(other.end)
        finally:
            if robot is not None:
                await asked(robot.end)

    asyncio.run(scene())

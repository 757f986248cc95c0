"""A robot on rmw_zenoh: the panel is a node among its nodes. The router and the robot's node are
processes; the node makes its keys, tokens and attachments by itself and ends at what is not whole."""

import asyncio
import logging
import time
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import AsyncExitStack, asynccontextmanager
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from app.cell.link.rosout import LOG_TYPE
from app.cell.session.fleet import Fleet
from app.cell.session.session import RobotSession
from app.panel.model import Panel
from app.records import NullLog
from app.ros.zenoh.config import config_to
from app.system.texts import say
from tests.support.builders import (
    BOOL,
    ENABLED,
    GUARDED,
    HEARD,
    MESSAGE,
    TEXT,
    panel_of,
    press_widget,
)
from tests.support.parts import ENOUGH_S
from tests.support.rmw import RmwNode, Router, router_without_admin_space
from tests.support.waiting import when

pytestmark = pytest.mark.promise("dialects")

log = logging.getLogger("kiosk.test")
CALL = {
    "id": "reset",
    "kind": "call",
    "label": "Reset",
    "service": "/reset",
    "type": "std_srvs/srv/Trigger",
}
GO = {**GUARDED, "id": "go", "topic": "/go"}
LATCHED = {"durability": "transient_local", "depth": 1}


def panel(*widgets: Any, **more: Any) -> Panel:
    return panel_of(MESSAGE, GO, HEARD, CALL, *widgets, dialect="rmw_zenoh", **more)


@pytest.fixture
def robot(router: Router) -> Iterator[RmwNode]:
    """A node that listens to /go and permits for good."""
    mine = RmwNode(router, "arm")
    mine.subscribe("/go", TEXT)
    mine.advertise(ENABLED, BOOL, **LATCHED)
    mine.publish(ENABLED, {"data": True})
    yield mine
    mine.end()


async def asked(function: Callable[..., Any], *arguments: Any) -> Any:
    return await asyncio.to_thread(function, *arguments)


@asynccontextmanager
async def session_with(router: Router, of_panel: Panel) -> AsyncIterator[RobotSession]:
    fleet = Fleet(of_panel, lambda _: config_to(router.endpoint), "r1", NullLog())
    await fleet.start()
    try:
        with fleet.first.publisher.watching(""):  # a client sees every page
            yield fleet.first
    finally:
        await fleet.stop()


def has_heard(robot: RmwNode, number: int) -> bool:
    return len(robot.heard("/go")) == number


def enabled(session: RobotSession, widget: str = "go") -> bool:
    return bool(session.publisher.view["widgets"][widget]["enabled"])


def joins(session: RobotSession) -> bool:
    return session.link_verdict.permitted


def reason(session: RobotSession, widget: str = "go") -> Any:
    return session.publisher.view["widgets"][widget]["reason"]


def link(session: RobotSession, lamp: str) -> Any:
    return session.publisher.view["link"][lamp]


def test_a_press_is_received_by_a_node_that_permits_it(router: Router, robot: RmwNode) -> None:
    async def scene() -> None:
        async with session_with(router, panel()) as session:
            await when(partial(enabled, session), "the last value of a latched topic came")
            assert (await session.check_readiness()).permitted
            for number, text in enumerate(("one", "two"), 1):
                receipt = await press_widget(session.presses, "go", {"message": text}, text)
                assert receipt.outcome == "published", receipt.reason
                await when(partial(has_heard, robot, number), "heard")
            assert robot.heard_data("/go") == ["one", "two"]
            assert robot.broken() == []
            await asked(robot.publish, ENABLED, {"data": False})
            await when(lambda: not enabled(session), "locked by the robot")
            assert (await press_widget(session.presses, "go", {"message": "x"})).outcome == "refused"

    asyncio.run(scene())


DIFFERENT_QOS: tuple[tuple[dict[str, Any], dict[str, Any]], ...] = (
    ({"reliability": "reliable"}, {"reliability": "best_effort"}),
    ({"durability": "transient_local"}, {"durability": "volatile"}),
)


@pytest.mark.parametrize(("ours", "theirs"), DIFFERENT_QOS)
def test_no_qos_is_incompatible_on_rmw_zenoh(
    router: Router, ours: dict[str, Any], theirs: dict[str, Any]
) -> None:
    """rmw_zenoh delivers all of them, both ways."""

    async def scene() -> None:
        strict = panel_of(
            MESSAGE,
            {**GO, "qos": theirs},
            interlock={"qos": ours, "max_age_s": 30.0},
            dialect="rmw_zenoh",
        )
        node = await asked(RmwNode, router, "arm")
        try:
            await asked(partial(node.subscribe, "/go", TEXT, **ours))
            await asked(partial(node.advertise, ENABLED, BOOL, **theirs))
            async with session_with(router, strict) as session:
                await asked(partial(node.every, ENABLED, {"data": True}, 0.2))
                await when(partial(enabled, session), "permitted")
                receipt = await press_widget(session.presses, "go", {"message": "x"})
                assert receipt.outcome == "published", receipt.reason
                await when(partial(has_heard, node, 1), "heard")
        finally:
            await asked(node.end)

    asyncio.run(scene())


def test_a_publisher_that_comes_late_is_heard(router: Router) -> None:
    """First the router alone, then a node, then its publisher: volatile and latched."""

    async def scene() -> None:
        async with session_with(router, panel()) as session:
            await when(lambda: session.link_verdict.code == "link_no_ros_node")
            assert link(session, "bridge")["name"] == say("router")
            robot = await asked(RmwNode, router, "arm")
            try:
                await when(lambda: session.link_verdict.permitted, "the node is seen")
                assert not enabled(session)
                for qos in ({}, LATCHED):
                    await asked(partial(robot.advertise, ENABLED, BOOL, **qos))
                    await when(partial(session.robot.graph.has_endpoint, "MP", ENABLED[1:]))
                    await asked(robot.publish, ENABLED, {"data": True})
                    await when(partial(enabled, session), f"permitted by {qos}")
                    await asked(robot.publish, ENABLED, {"data": False})
                    await when(lambda: not enabled(session), f"forbidden by {qos}")
                    await asked(robot.withdraw, ENABLED)
            finally:
                await asked(robot.end)

    asyncio.run(scene())


def test_the_panel_is_a_node_with_its_endpoints_and_each_panel_has_its_name(
    router: Router, robot: RmwNode
) -> None:
    async def scene() -> None:
        async with session_with(router, panel()) as first:
            await when(lambda: first.link_verdict.permitted)
            assert robot.nodes().count("/web_ui") == 1
            assert robot.clients() == ["/reset"]
            (endpoint,) = robot.endpoints("/go")
            assert (endpoint["node"], endpoint["type"], endpoint["reliability"]) == (
                "web_ui",
                TEXT,
                "reliable",
            )
            assert robot.subscribers(ENABLED) == 1
            async with session_with(router, panel()) as second:
                await when(lambda: second.link_verdict.permitted)
                await when(lambda: sorted(robot.nodes()) == ["/arm", "/web_ui", "/web_ui_2"])
                assert first.robot.graph.nodes == {"/arm"}  # a panel is no robot
            await when(lambda: "/web_ui_2" not in robot.nodes())
        await when(lambda: robot.nodes() == ["/arm"], "the panel has left")

    asyncio.run(scene())


def test_panels_that_join_at_once_have_names_of_their_own(router: Router, robot: RmwNode) -> None:
    async def scene() -> None:
        async with AsyncExitStack() as open_sessions:
            sessions = [session_with(router, panel()) for _ in range(3)]
            joined = await asyncio.gather(*map(open_sessions.enter_async_context, sessions))
            for session in joined:
                await when(partial(joins, session))
            names = ["/arm", "/web_ui", "/web_ui_2", "/web_ui_3"]
            await when(lambda: sorted(robot.nodes()) == names)

    asyncio.run(scene())


def test_the_panels_log_is_kept_for_nodes_that_subscribe_late(router: Router, robot: RmwNode) -> None:
    async def scene() -> None:
        async with session_with(router, panel()) as session:
            await when(partial(enabled, session))
            late = await asked(RmwNode, router, "late")
            try:
                await when(lambda: "/late" in session.robot.graph.nodes, "its line is written")
                log.warning("said before the node subscribes")
                of_logs = {"durability": "transient_local", "depth": 1000}
                await asked(partial(late.subscribe, "/rosout", LOG_TYPE, **of_logs))
                await when(lambda: "said before the node subscribes" in str(late.heard("/rosout")))
            finally:
                await asked(late.end)

    asyncio.run(scene())


def test_a_killed_node_is_known_at_once_by_its_name(router: Router, robot: RmwNode) -> None:
    other = RmwNode(router, "other")  # the robot is still there without the arm

    async def scene() -> float:
        async with session_with(router, panel()) as session:
            await when(partial(enabled, session))
            killed_at = time.monotonic()
            await asked(robot.kill)
            await when(lambda: not enabled(session), "locked")
            locked_s = time.monotonic() - killed_at
            await when(lambda: link(session, "node")["state"] == "bad")
            assert link(session, "node")["text"] == say("link_node_ended")
            assert str(link(session, "node")["reason"]) == "Node /arm has ended. Restart it."
            assert link(session, "bridge")["state"] == "ok"
            again = await asked(RmwNode, router, "arm")
            try:
                await asked(again.subscribe, "/go", TEXT)
                await asked(partial(again.advertise, ENABLED, BOOL, **LATCHED))
                await when(lambda: link(session, "node")["state"] == "ok", "it is there again")
                assert not enabled(session)  # it has not said anything yet
                await asked(again.publish, ENABLED, {"data": True})
                await when(partial(enabled, session))
            finally:
                await asked(again.end)
            return locked_s

    try:
        assert asyncio.run(scene()) < ENOUGH_S
    finally:
        other.end()


def test_a_frozen_router_locks_and_a_thawed_one_unlocks(router: Router, robot: RmwNode) -> None:
    async def scene() -> None:
        async with session_with(router, panel()) as session:
            await when(partial(enabled, session))
            router.freeze()
            try:
                await when(lambda: session.link_verdict.code == "link_router_silent", "silent")
                assert not enabled(session)
                refused = await press_widget(session.presses, "go", {"message": "x"})
                assert refused.outcome == "refused"
            finally:
                router.thaw()
            await when(lambda: session.link_verdict.permitted, "it answers again")
            await asked(robot.publish, ENABLED, {"data": True})
            await when(partial(enabled, session))
        assert robot.heard_data("/go") == []

    asyncio.run(scene())


def test_a_router_without_an_admin_space_locks_and_says_what_it_lacks(tmp_path: Path) -> None:
    """Nothing can show that such a router still responds."""
    mine = router_without_admin_space(tmp_path)
    mine.start()
    robot = RmwNode(mine, "arm")

    async def scene() -> None:
        async with session_with(mine, panel()) as session:
            await when(lambda: session.link_verdict.code == "link_router_no_admin", "its reason")
            assert not enabled(session)
            assert link(session, "bridge")["state"] == "bad"

    try:
        asyncio.run(scene())
    finally:
        robot.end()
        mine.end()


def test_a_press_that_a_router_does_not_confirm_is_unknown(router: Router, robot: RmwNode) -> None:
    async def scene() -> None:
        async with session_with(router, panel()) as session:
            await when(partial(enabled, session))
            router.freeze()
            try:
                receipt = await press_widget(session.presses, "go", {"message": "lost"})
            finally:
                router.thaw()
            if receipt.outcome != "refused":  # the silence was noticed before
                assert (receipt.outcome, receipt.code) == ("unknown", "press_router_no_response")

    asyncio.run(scene())


def test_a_killed_router_locks_and_everything_is_joined_again(router: Router, robot: RmwNode) -> None:
    async def scene() -> None:
        async with session_with(router, panel()) as session:
            await when(partial(enabled, session))
            await asked(router.kill)
            await when(lambda: not session.robot.link_up, "the link is lost")
            assert session.link_verdict.code == "link_router_unreachable"
            assert not enabled(session)
            await asked(router.start)
            await when(partial(enabled, session), "joined again")
            receipt = await press_widget(session.presses, "go", {"message": "again"})
            assert receipt.outcome == "published", receipt.reason
            await when(lambda: robot.heard_data("/go") == ["again"])

    asyncio.run(scene())


def test_a_press_without_a_subscriber_is_unknown(router: Router) -> None:
    async def scene() -> None:
        robot = await asked(RmwNode, router, "arm")
        try:
            await asked(partial(robot.advertise, ENABLED, BOOL, **LATCHED))
            await asked(robot.publish, ENABLED, {"data": True})
            async with session_with(router, panel()) as session:
                await when(partial(enabled, session))
                receipt = await press_widget(session.presses, "go", {"message": "anybody"})
                assert (receipt.outcome, receipt.code) == ("unknown", "press_no_subscriber")
        finally:
            await asked(robot.end)

    asyncio.run(scene())


def test_another_type_and_another_distribution_lock_and_say_so(router: Router, robot: RmwNode) -> None:
    async def scene() -> None:
        of_number = {**HEARD, "id": "number", "topic": "/number", "type": "std_msgs/msg/Int32"}
        async with session_with(router, panel(of_number)) as session:
            await when(partial(enabled, session))
            await asked(robot.subscribe, "/go", BOOL)
            await when(lambda: not enabled(session))
            assert reason(session).code == "topic_wrong_type"
        async with session_with(router, panel(distro="humble")) as session:
            await when(lambda: session.link_verdict.permitted)
            await when(lambda: getattr(reason(session), "code", "") != "interlock_waiting")
            assert not enabled(session)
            shown = str(link(session, "node")["reason"])
            assert "TypeHashNotSupported" in shown
            assert "RIHS01_" in shown

    asyncio.run(scene())


def test_an_interlock_with_one_publisher_counts_each_publisher_of_a_session(
    router: Router, robot: RmwNode
) -> None:
    async def scene() -> None:
        async with session_with(router, panel(interlock={"publishers": "one"})) as session:
            await when(partial(enabled, session))
            other = await asked(RmwNode, router, "intruder")
            try:
                await asked(other.advertise, ENABLED, BOOL)
                await when(lambda: not enabled(session))
                assert "/intruder" in str(reason(session))
            finally:
                await asked(other.end)
            await when(lambda: getattr(reason(session), "code", "") != "interlock_several_publishers")

    asyncio.run(scene())


def test_the_robot_of_another_domain_is_not_there(router: Router, robot: RmwNode) -> None:
    async def scene() -> None:
        async with session_with(router, panel(domain=3)) as session:
            await when(lambda: session.link_verdict.code == "link_no_ros_node")

    asyncio.run(scene())

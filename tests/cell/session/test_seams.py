"""Where one part meets another: what fails in one must not make another act on a doubt."""

import asyncio
import itertools
import threading
import time
from collections.abc import Iterable, Mapping
from typing import Any, ClassVar

import pytest

from app.cell.commands import holds
from app.cell.commands.holds import ActiveHold
from app.cell.commands.receipts import MAX_KEPT_CHARS, Receipt
from app.cell.commands.services import with_fields
from app.cell.link import liveness
from app.cell.link.bridge import BRIDGE as BRIDGES
from app.cell.permission.interlocks import interlock_verdict
from app.cell.robot.sample_handlers import SampleHandler, SampleHandlers
from app.cell.robot.state import RobotState, Sample, SkippedPayload
from app.cell.session import session as renewal
from app.cell.session.ingest import Ingest, Updates
from app.cell.session.session import RobotSession, ServerParts, wire_session
from app.cell.view.kinds import Enabled
from app.cell.view.view import build_view
from app.panel.model import Panel
from app.records import NullLog
from app.records.principal import Principal, anonymous
from app.ros.zenoh.config import config_to
from app.ros.zenoh.inbox import Changes, Token
from app.system.texts import say
from app.tools.simulator.in_process import in_process
from tests.cell.commands.test_holds import HALF, JOG, POINT, SPEED
from tests.cell.commands.test_presses import Bench, Way
from tests.support.builders import (
    BOOL,
    BRIDGE,
    COUNT,
    ENABLED,
    HEARD,
    INTERFACES,
    NOW,
    endpoint,
    guard_of,
    panel_of,
    permits,
    press_of,
    press_widget,
    presses_of,
    robot_there,
    small_panel,
)
from tests.support.parts import ENOUGH_S
from tests.support.waiting import turns, when


def flag(value: bool) -> bytes:
    return INTERFACES.encode(BOOL, {"data": value})


def sample(payload: bytes, *between: bytes) -> Sample:
    passed = tuple(SkippedPayload(payload, NOW, NOW) for payload in between)
    return Sample(payload, 9, NOW, NOW, BRIDGE, skipped_payloads=passed)


class Broken:
    """A part that fails at whatever it hears."""

    def __getattr__(self, name: str) -> Any:
        raise RuntimeError(name)


def intake_of(panel: Panel, robot: RobotState) -> Ingest:
    return Ingest(panel, robot, SampleHandlers())


def session_of(panel: Panel, endpoint: str) -> RobotSession:
    return wire_session(ServerParts(panel, "r1", NullLog()), config_to(endpoint), BRIDGES)


def taken(steps: Iterable[Updates], page: "Page") -> Updates:
    """What is taken in, with each step shown; the last of them."""
    seen = []
    for updates in steps:
        page.show()
        seen.append(updates)
    return seen[-1]


class Page:
    """The permissions as they were last shown."""

    def __init__(self, panel: Panel, robot: RobotState) -> None:
        self._panel = panel
        self._robot = robot
        self.said: list[bool] = []
        self.show()

    def show(self) -> None:
        self._view = build_view(self._panel, self._robot, time.monotonic()).view["interlocks"]
        if (said := self._robot.reading(ENABLED).value("data")) is not None:
            self.said.append(said)

    def shown(self) -> Mapping[str, Enabled]:
        return self._view


def test_error_at_a_sample_does_not_keep_locks_from_closing(caplog: pytest.LogCaptureFixture) -> None:
    panel = panel_of(COUNT)
    robot = robot_there(panel)
    permits(robot)
    feedback, handlers = "count/_action/feedback", SampleHandlers()
    handlers.add(feedback, SampleHandler(lambda received: Broken().take(received)))
    intake = Ingest(panel, robot, handlers)
    changes = Changes({feedback: sample(b""), robot.key(ENABLED): sample(flag(False))}, {}, True)
    page = Page(panel, robot)
    news = taken(intake.steps(changes), page)
    assert (news.urgent, news.peer_appeared) == (True, False)
    assert robot.reading(ENABLED).value("data") is False
    assert "was not processed completely" in caplog.text


def test_a_permission_that_blinked_is_shown_in_between() -> None:
    panel = small_panel()
    robot = robot_there(panel)
    intake = intake_of(panel, robot)
    page = Page(panel, robot)
    blink = Changes({robot.key(ENABLED): sample(flag(True), flag(True), flag(False))}, {}, True)
    taken(intake.steps(blink), page)
    assert page.said == [True, False, True]
    assert robot.reading(ENABLED).value("data") is True


def test_permission_that_overran_the_inbox_locks_before_its_newest_value() -> None:
    panel = small_panel()
    robot = robot_there(panel)
    permits(robot)
    page = Page(panel, robot)
    shown: list[bool] = []
    overrun = sample(flag(True), flag(True))._replace(overrun=True)
    for _ in intake_of(panel, robot).steps(Changes({robot.key(ENABLED): overrun}, {}, True)):
        page.show()
        shown.append(page.shown()["operation"]["enabled"])
    assert shown == [False, True, True]


def test_a_permission_that_is_said_again_is_not_urgent() -> None:
    """A node may say it a hundred times a second: nothing but a change is shown at once."""
    panel = small_panel(interlock={"max_age_s": 1.0})
    robot = robot_there(panel)
    intake = intake_of(panel, robot)
    key, page = robot.key(ENABLED), Page(panel, robot)

    def said(permitted: bool) -> tuple[bool, set[str]]:
        changes = Changes({key: sample(flag(permitted))}, {}, True)
        news = taken(intake.steps(changes), page)
        page.show()
        return news.urgent, news.values

    assert said(False) == (True, {key})
    assert said(False) == (False, {key})
    assert said(True) == (True, {key})
    assert said(True) == (False, {key})
    assert robot.reading(ENABLED).value("data") is True


def test_unreadable_permission_sample_is_urgent() -> None:
    panel = small_panel()
    robot = robot_there(panel)
    permits(robot)
    intake = intake_of(panel, robot)
    changes = Changes({robot.key(ENABLED): sample(b"broken")}, {}, True)
    page = Page(panel, robot)
    assert taken(intake.steps(changes), page).urgent


def test_each_sample_of_a_recorded_topic_is_recorded_and_no_other() -> None:
    class Tape:
        keys = frozenset({"heard"})
        heard: ClassVar[list[bytes]] = []

        def record_sample(self, *about: Any) -> None:
            self.heard.append(about[1].payload)

    panel = small_panel()
    tape: Any = Tape()
    robot = robot_there(panel)
    intake = Ingest(panel, robot, SampleHandlers(), [tape])
    assert intake.recorded == tape.keys
    kept = [("heard", sample(said)) for said in (b"1", b"2", b"3")]
    page = Page(panel, robot)
    taken(intake.steps(Changes({"heard": kept[-1][1]}, {}, True, kept)), page)
    assert tape.heard == [b"1", b"2", b"3"]


def test_a_list_that_is_too_short_is_shown_as_nothing() -> None:
    type_name = "sensor_msgs/msg/JointState"
    names = INTERFACES.field_reader(type_name, ["name[0]", "name[1]"])
    payload = INTERFACES.encode(type_name, JOINTS)
    assert with_fields("{name[0]}, {name[1]}", names.read(payload)) == "a, —"


JOINTS = {
    "header": {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""},
    "name": ["a"],
    "position": [],
    "velocity": [],
    "effort": [],
}


def test_a_large_press_leaves_no_large_receipt() -> None:
    bench = Bench()
    large = {"message": "x" * (MAX_KEPT_CHARS + 1)}
    refused = bench.press(inputs=large)
    assert (refused.cause, refused.inputs) == ("input", {})
    assert bench.press(inputs=large) == refused
    other = bench.press(inputs={"message": "y" * (MAX_KEPT_CHARS + 1)})
    assert "already used" in str(other.reason)


def test_a_press_in_doubt_is_not_answered_with_another_press() -> None:
    panel = small_panel()
    robot = robot_there(panel)
    permits(robot)
    presses = presses_of(panel, robot, Way(), guard=guard_of(panel, robot, other_views=["0ther"]))

    async def pressed() -> None:
        first = await press_widget(presses, "free", {"message": "a"}, "p1")
        other = await press_widget(presses, "guarded", {"message": "a"}, "p1", seen="0ther-1")
        assert (first.outcome, other.outcome, other.widget) == ("published", "refused", "guarded")
        assert "already used" in str(other.reason)
        new = await press_widget(presses, "guarded", {"message": "a"}, "p2", seen="0ther-1")
        assert (new.outcome, new.cause) == ("refused", "interlock")
        assert "another robot" in str(new.reason)

    asyncio.run(pressed())


def test_a_link_that_is_lost_while_it_is_renewed_is_renewed_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """And whatever Zenoh makes of it, it is tried until there is a session."""
    monkeypatch.setattr(renewal, "RENEW_AGAIN_S", 0.01)
    renewals: list[str] = []
    lost_again = threading.Event()

    async def renewed(times: int) -> None:
        await when(lambda: len(renewals) >= times)

    async def lost() -> None:
        session = session_of(small_panel(), "tcp/127.0.0.1:1")

        def renew() -> None:
            renewals.append("renewed")
            assert lost_again.wait(ENOUGH_S)
            if len(renewals) == 2:
                raise RuntimeError("no session")

        monkeypatch.setattr(session.link, "renew", renew)
        session.renew()
        await renewed(1)
        session.renew()
        lost_again.set()
        await renewed(3)
        await turns()
        assert len(renewals) == 3
        session.renew()
        await renewed(4)
        await session.stop()

    asyncio.run(lost())
    assert len(renewals) == 4


def test_publisher_replaced_between_turns_must_publish_again() -> None:
    panel = small_panel({"require_publisher": True})
    robot = robot_there(panel)
    interlock = panel.interlocks[0]
    token = endpoint(robot, "MP", ENABLED, BOOL)
    robot.update_publishers()
    permits(robot)
    intake = intake_of(panel, robot)
    page = Page(panel, robot)
    key = robot.key(ENABLED)
    old, new = Sample(flag(True), 6, NOW, NOW, BRIDGE), Sample(flag(True), 8, NOW, NOW, BRIDGE)
    for said, permitted in ((old, False), (new, True)):
        taken(intake.steps(Changes({key: said}, {token: Token(True, 7)}, True)), page)
        robot.update_publishers()
        assert interlock_verdict(interlock, robot, NOW).permitted is permitted


def test_replacing_the_session_ends_holds_first(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for module in (holds, holds):  # a busy machine misses heartbeats
        monkeypatch.setattr(module, "LEASE_S", ENOUGH_S)
    for limit in ("STALLED_S", "SILENT_S"):  # and its loop stands still
        monkeypatch.setattr(liveness, limit, ENOUGH_S)

    async def scene() -> None:
        panel = panel_of(SPEED, JOG, {**HEARD, "topic": "/last_heard"}, mode="demo")
        with in_process(panel) as there:
            session = session_of(panel, there)
            await session.start()
            sent: list[float] = []
            put = session.link.put

            def noted(key: str, payload: bytes) -> None:
                if key == "jog":
                    sent.append(INTERFACES.decode(POINT, payload).x)
                put(key, payload)

            monkeypatch.setattr(session.link, "put", noted)
            ended: list[Receipt] = []
            async with asyncio.timeout(ENOUGH_S):
                await when(lambda: session.publisher.view["widgets"]["jog"]["enabled"])
                hold = session.holds.begin(
                    press_of(session.holds.widget("jog"), HALF), time.monotonic(), ended.append
                )
                assert isinstance(hold, ActiveHold)
                lost = session.robot.key("/last_heard")
                monkeypatch.setattr(
                    type(session.robot.graph), "is_unrouted", lambda _, key: key == lost
                )
                for number in itertools.count(1):
                    if ended:
                        break
                    session.holds.beat(hold, number, time.monotonic())
                    await asyncio.sleep(0.05)
            assert sent[-1] == 0.0
            assert "is being reconnected" in str(ended[0].reason)
            await session.stop()

    asyncio.run(scene())


def test_ending_session_sends_no_more_messages() -> None:
    async def pressed() -> None:
        session = session_of(small_panel(), "tcp/127.0.0.1:1")
        permits(session.robot)
        who = Principal(anonymous("192.0.2.1"))
        assert not session.press_guard.conditions(who).ending
        await session.stop()
        assert session.press_guard.conditions(who).ending == "server_shutting_down"

    asyncio.run(pressed())


def test_take_of_a_panel_locks_with_its_own_reason_until_the_end() -> None:
    async def taken() -> None:
        session = session_of(small_panel(), "tcp/127.0.0.1:1")
        guard, who = session.press_guard, Principal(anonymous("192.0.2.1"))
        for _ in range(2):
            guard.close("panel_being_taken")
            assert guard.act_verdict(None).reason == say("panel_being_taken")
            guard.reopen()
            assert guard.act_verdict(None).permitted
        guard.close("panel_being_taken")
        await session.stop()
        assert guard.conditions(who).ending == "panel_being_taken"

    asyncio.run(taken())

"""A publisher of a permission that appears and says nothing: what was said before is a doubt."""

import asyncio
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from datetime import UTC, datetime

import pytest

from app.cell.commands.parameters import ParameterSync
from app.cell.commands.services import ServiceCalls
from app.cell.permission.interlocks import interlock_verdict
from app.cell.permission.verdict import Verdict
from app.cell.robot.publishers import SilentPublishers
from app.cell.robot.sample_handlers import SampleHandlers
from app.cell.robot.state import RobotState
from app.cell.session.ingest import Ingest
from app.ros.dialects.bridge_dialect import token
from app.ros.dialects.dialect import Endpoint
from app.ros.messages.names import Qos
from app.ros.zenoh.inbox import Inbox
from app.ros.zenoh.sample import Sample
from tests.support.builders import (
    BOOL,
    BRIDGE,
    ENABLED,
    INTERFACES,
    KIOSK,
    TRAITS,
    FakeTransport,
    robot_there,
    small_panel,
)
from tests.support.words import english

KEY = ENABLED[1:]
OTHER = "b2"
DELAY_S, SINGLE_S = TRAITS.token_delay_s, TRAITS.token_delay_single_s
TRUE, FALSE = b"\0\1\0\0\1", b"\0\1\0\0\0"
PUBLISHER = Endpoint(BRIDGE, "MP", KEY, BOOL)


@pytest.fixture
def known() -> SilentPublishers:
    return SilentPublishers([KEY], TRAITS)


def silent(known: SilentPublishers, *bridges: str) -> bool:
    return known.has_silent(KEY, bridges or [BRIDGE])


def test_a_publisher_that_appears_and_says_nothing_is_silent(known: SilentPublishers) -> None:
    known.record_message(KEY, BRIDGE, 1, 0.0)
    known.add_publisher(PUBLISHER, 2, 10.0)
    assert silent(known)
    known.record_message(KEY, BRIDGE, 3, 10.1)
    assert not silent(known)


def test_publisher_that_left_without_a_message_still_counts_as_silent(known: SilentPublishers) -> None:
    known.record_message(KEY, BRIDGE, 1, 0.0)
    known.add_publisher(PUBLISHER, 2, 10.0)
    known.remove_publisher(PUBLISHER, 3)
    assert silent(known)


@pytest.mark.parametrize(
    ("latched", "before_s", "is_silent"),
    [
        (False, 0.0, False),
        (False, DELAY_S, False),
        (False, DELAY_S + 0.1, True),
        (True, DELAY_S + 0.1, False),  # it loses nothing, and says nothing twice
        (True, TRAITS.token_delay_latched_s + 0.1, True),
    ],
)
def test_a_message_just_before_its_publisher_appears_is_its_own(
    known: SilentPublishers, latched: bool, before_s: float, is_silent: bool
) -> None:
    known.record_message(KEY, BRIDGE, 1, 10.0)
    known.add_publisher(replace(PUBLISHER, transient_local=latched), 2, 10.0 + before_s)
    assert silent(known) is is_silent


def test_message_counts_for_its_own_publisher_only(known: SilentPublishers) -> None:
    known.record_message(KEY, BRIDGE, 1, 10.0)
    known.add_publisher(PUBLISHER, 2, 10.05)
    known.remove_publisher(PUBLISHER, 3)
    known.add_publisher(PUBLISHER, 4, 10.1)
    assert silent(known)


def test_message_of_an_earlier_publisher_does_not_count_for_the_next(known: SilentPublishers) -> None:
    known.add_publisher(PUBLISHER, 1, 10.0)
    known.record_message(KEY, BRIDGE, 2, 10.1)
    known.remove_publisher(PUBLISHER, 3)
    known.add_publisher(PUBLISHER, 4, 10.2)
    assert silent(known)


def test_message_ingested_before_its_earlier_token_counts(
    known: SilentPublishers,
) -> None:
    known.record_message(KEY, BRIDGE, 5, 99.0)
    known.add_publisher(PUBLISHER, 4, 10.0)
    assert not silent(known)


def test_only_the_bridge_of_the_publisher_can_bring_its_message(known: SilentPublishers) -> None:
    known.record_message(KEY, OTHER, 1, 10.0)
    known.add_publisher(PUBLISHER, 2, 10.0)
    known.record_message(KEY, OTHER, 3, 10.1)
    assert silent(known)
    assert not silent(known, OTHER)
    known.record_message(KEY, None, 4, 10.2)  # a bridge that does not say who it is
    assert not silent(known)


def test_a_bridge_that_goes_leaves_its_doubt_to_the_next_message(known: SilentPublishers) -> None:
    known.record_message(KEY, OTHER, 1, 0.0)
    known.add_publisher(PUBLISHER, 2, 10.0)
    known.remove_peer(BRIDGE)
    assert silent(known, OTHER)
    known.record_message(KEY, OTHER, 3, 10.1)
    assert not silent(known, OTHER)


def test_other_topics_and_subscribers_are_ignored(known: SilentPublishers) -> None:
    known.add_publisher(Endpoint(BRIDGE, "MP", "heard", BOOL), 1, 10.0)
    known.add_publisher(Endpoint(BRIDGE, "MS", KEY, BOOL), 2, 10.0)
    known.add_publisher(Endpoint(BRIDGE), 3, 10.0)
    known.record_message("heard", BRIDGE, 4, 10.0)
    known.remove_publisher(Endpoint(BRIDGE, "MS", KEY, BOOL), 5)
    assert not silent(known)
    assert not known.has_silent("heard", [BRIDGE])


@dataclass
class Incoming:
    """What comes by the link, and what an interlock makes of it."""

    inbox: Inbox
    intake: Ingest
    robot: RobotState

    def says(self, payload: bytes) -> None:
        self.inbox.put(KEY, payload, Stamp())

    def publisher(self, alive: bool, zid: str = BRIDGE) -> None:
        self.inbox.token(token(zid, "MP", KEY, BOOL, Qos(), INTERFACES.type_hash(BOOL)), alive)

    @property
    def verdict(self) -> Verdict:
        for _ in self.intake.steps(self.inbox.drain()):
            pass
        (interlock,) = small_panel().interlocks
        return interlock_verdict(interlock, self.robot, 1e9)


class Stamp:
    def get_id(self) -> str:
        return BRIDGE

    def get_time(self) -> datetime:
        return datetime.fromtimestamp(0, UTC)


@pytest.fixture
def incoming() -> Iterator[Incoming]:
    with asyncio.Runner() as runner:  # some parts need a loop to be made on
        yield runner.run(made())


async def made() -> Incoming:
    panel, services = small_panel(), FakeTransport()
    robot = robot_there(panel)
    calls = ServiceCalls(INTERFACES, robot, services, lambda _: None)
    inbox = Inbox(lambda _: None)
    inbox.set_topics([], [KEY], [])
    handlers = SampleHandlers()
    ParameterSync(panel, INTERFACES, robot, services, calls, lambda: None).register(handlers)
    intake = Ingest(panel, robot, handlers)
    return Incoming(inbox, intake, robot)


Event = Callable[[Incoming], None]


def true(incoming: Incoming) -> None:
    incoming.says(TRUE)


def false(incoming: Incoming) -> None:
    incoming.says(FALSE)


def appears(incoming: Incoming) -> None:
    incoming.publisher(True)


def goes(incoming: Incoming) -> None:
    incoming.publisher(False)


def looked(incoming: Incoming) -> None:
    assert incoming.verdict


ORDERS: list[tuple[tuple[Event, ...], str]] = [
    ((true, appears), "permitted"),
    ((appears, true), "permitted"),
    ((true, appears, goes), "permitted"),
    ((true, appears, goes, appears), "interlock_new_publisher"),
    ((true, appears, goes, appears, goes), "interlock_new_publisher"),
    ((true, appears, goes, true, appears), "permitted"),
    ((true, appears, goes, false, appears), "interlock_not_permitted"),
    ((true, appears, goes, appears, false), "interlock_not_permitted"),
    ((true, appears, goes, appears, true), "permitted"),
    ((appears, true, goes, appears), "interlock_new_publisher"),
    ((appears, goes), "interlock_waiting"),
    ((true, appears, appears), "permitted"),  # announced twice
]


@pytest.mark.parametrize(("events", "code"), ORDERS)
@pytest.mark.parametrize("look", ["at_the_end", "each_time"])
def test_a_permission_in_each_order_of_tokens_and_messages(
    incoming: Incoming, events: tuple[Event, ...], code: str, look: str
) -> None:
    for event in events:
        event(incoming)
        if look == "each_time":
            looked(incoming)
    assert incoming.verdict.code == code


def test_the_reason_names_the_topic(incoming: Incoming) -> None:
    for event in (true, appears, goes, appears):
        event(incoming)
    assert (
        english(incoming.verdict.reason)
        == f"Locked: a new publisher of {ENABLED} has not published yet."
    )


def test_a_new_session_starts_without_the_silence_of_the_last(incoming: Incoming) -> None:
    for event in (true, appears, goes, appears, looked):
        event(incoming)
    incoming.robot.mark_link_lost()
    assert not incoming.robot.silent_publishers.has_silent(KEY, [BRIDGE])


def test_the_panels_own_publisher_is_none_of_the_robots(incoming: Incoming) -> None:
    true(incoming)
    looked(incoming)
    incoming.publisher(True, KIOSK)
    incoming.publisher(False, KIOSK)
    assert incoming.verdict.permitted


WINDOW = [(DELAY_S + 0.1, False), (SINGLE_S, False), (SINGLE_S + 0.1, True)]


@pytest.mark.parametrize(("before_s", "is_silent"), WINDOW)
def test_a_message_within_the_joining_window_is_that_of_the_only_publisher(
    known: SilentPublishers, before_s: float, is_silent: bool
) -> None:
    known.record_message(KEY, BRIDGE, 1, 10.0)
    known.add_publisher(PUBLISHER, 2, 10.0 + before_s)
    assert silent(known)
    known.mark_single(KEY)
    assert silent(known) is is_silent


@pytest.mark.parametrize("end", ["publisher", "bridge"])
def test_ended_publisher_does_not_count_as_the_only_publisher(
    known: SilentPublishers, end: str
) -> None:
    known.record_message(KEY, BRIDGE, 1, 10.0)
    known.add_publisher(PUBLISHER, 2, 12.0)
    if end == "publisher":
        known.remove_publisher(PUBLISHER, 3)
    else:
        known.remove_peer(BRIDGE)
    known.mark_single(KEY)
    assert silent(known)


def test_publishers_second_appearance_needs_a_new_message(known: SilentPublishers) -> None:
    known.record_message(KEY, BRIDGE, 1, 10.0)
    known.add_publisher(PUBLISHER, 2, 12.0)
    known.add_publisher(PUBLISHER, 4, 12.1, lost_before=3)
    known.mark_single(KEY)
    assert silent(known)


@pytest.mark.parametrize(("nodes", "code"), [(1, "permitted"), (2, "interlock_new_publisher")])
def test_a_late_token_locks_until_the_only_publisher_is_known(nodes: int, code: str) -> None:
    robot = robot_there(small_panel())
    robot.update(KEY, Sample(TRUE, 1, 10.0, 10.0, BRIDGE))
    robot.graph.apply_token(token(BRIDGE, "MP", KEY, BOOL, Qos(), ""), True, 12.0)
    robot.silent_publishers.add_publisher(PUBLISHER, 2, 12.0)
    (interlock,) = small_panel().interlocks
    robot.update_nodes()
    assert interlock_verdict(interlock, robot, 12.0).code == "interlock_new_publisher"
    names = ["/cell_io", "/teach_box"][:nodes]
    robot.graph.update_routes((), [replace(PUBLISHER, node=name) for name in names], 12.1)
    robot.update_nodes()
    verdict = interlock_verdict(interlock, robot, 12.2)
    assert verdict.code == code
    assert verdict.permitted or all(name in english(verdict.reason) for name in names)

"""What a link's threads put in, and what the event loop takes out: no Zenoh, no threads."""

from collections.abc import Collection
from datetime import UTC, datetime

import pytest

from app.ros.zenoh.inbox import (
    KEPT_BYTES,
    KEPT_MOST,
    NUMBERS,
    UNSEEN_BYTES,
    UNSEEN_MOST,
    Cache,
    Inbox,
    Number,
)
from tests.budgets import check


class Sent:
    """A time stamp of the clock of `source`."""

    def __init__(self, time: float, source: str = "b1") -> None:
        self.time = time
        self.source = source

    def get_id(self) -> str:
        return self.source

    def get_time(self) -> datetime:
        return datetime.fromtimestamp(self.time, UTC)


@pytest.fixture
def woken() -> list[bool]:
    return []


@pytest.fixture
def inbox(woken: list[bool]) -> Inbox:
    """`permit` is lossless and immediate, `parts` lossless, `status` immediate, `taped` recorded,
    `guard` changing."""
    mine = Inbox(woken.append)
    mine.set_topics(["status", "permit"], ["permit", "parts"], ["taped"], ["guard", "taped"])
    return mine


def test_topic_keeps_the_newest_sample_and_counts_skipped_ones(inbox: Inbox) -> None:
    for said in (b"one", b"two", b"three"):
        inbox.put("heard", said, None)
    sample = inbox.drain().samples["heard"]
    assert (sample.payload, sample.skipped, sample.skipped_payloads) == (b"three", 2, ())
    assert inbox.drain().samples == {}


def test_a_sample_has_its_source_and_its_time_there(inbox: Inbox) -> None:
    inbox.put("heard", b"", Sent(7.5))
    inbox.put("unstamped", b"", None)
    samples = inbox.drain().samples
    assert (samples["heard"].source, samples["heard"].sent) == ("b1", 7.5)
    assert (samples["unstamped"].source, samples["unstamped"].sent) == (None, None)
    inbox.put("heard", b"", Sent(7.6))
    again = inbox.drain().samples["heard"]
    assert (again.source, again.sent) == ("b1", None)  # read once a second, and for recordings


def test_values_wake_the_loop_once_until_they_are_taken(inbox: Inbox, woken: list[bool]) -> None:
    for _ in range(1000):
        inbox.put("heard", b"", None)
    assert woken == [False]
    inbox.drain()
    inbox.put("heard", b"", None)
    assert woken == [False, False]


@pytest.mark.parametrize("key", ["permit", "status"])
def test_immediate_data_waits_for_no_value(inbox: Inbox, woken: list[bool], key: str) -> None:
    inbox.put("heard", b"", None)
    inbox.put(key, b"", None)
    inbox.put(key, b"", None)
    inbox.put("heard", b"", None)
    assert woken == [False, True]


def test_parts_of_a_list_are_kept_and_wait_for_a_frame(inbox: Inbox, woken: list[bool]) -> None:
    for said in (b"arm", b"gripper", b"arm"):
        inbox.put("parts", said, None)
    sample = inbox.drain().samples["parts"]
    assert woken == [False]
    assert [skipped.payload for skipped in sample.skipped_payloads] == [b"arm", b"gripper"]


def test_the_graph_and_the_link_are_immediate(inbox: Inbox, woken: list[bool]) -> None:
    inbox.put("heard", b"", None)
    inbox.token("t", True)
    inbox.drain()
    inbox.transport("z", True)
    assert woken == [False, True, True]


def test_samples_and_losses_are_in_order(inbox: Inbox) -> None:
    inbox.put("before", b"", None)
    inbox.token("t", True)
    inbox.token("t", False)
    inbox.token("t", True)
    inbox.put("after", b"", None)
    changes = inbox.drain()
    token = changes.tokens["t"]
    assert token.alive
    order = [changes.samples["before"].seq, token.lost_seq, token.came_seq]
    assert sorted(order) == order
    assert token.came_seq < changes.samples["after"].seq
    assert token.lost_before == token.lost_seq


def test_published_message_is_never_dropped_for_its_stamp(inbox: Inbox) -> None:
    """A clock that was an hour ahead and was set right made all that came later "older"."""
    inbox.put("permit", b"true", Sent(3600.0))
    assert inbox.drain().samples["permit"].payload == b"true"
    for time in (1.0, 2.0, 3601.0, 3.0):
        inbox.put("permit", b"%d" % time, Sent(time))
        assert inbox.drain().samples["permit"].payload == b"%d" % time


def test_cached_sample_counts_until_its_source_publishes(inbox: Inbox) -> None:
    inbox.put_cached("heard", b"cached", Sent(9.0))
    assert inbox.drain().samples["heard"].payload == b"cached"
    inbox.put("heard", b"new", Sent(2.0))
    inbox.put_cached("heard", b"cached", Sent(9.0))
    assert inbox.drain().samples["heard"].payload == b"new"
    inbox.put_cached("heard", b"of another bridge", Sent(1.0, "b2"))
    assert inbox.drain().samples["heard"].payload == b"of another bridge"


def test_cached_sample_without_a_stamp_counts_before_any_publication(inbox: Inbox) -> None:
    inbox.put_cached("heard", b"cached", None)
    assert inbox.drain().samples["heard"].payload == b"cached"
    inbox.put("heard", b"new", None)
    inbox.put_cached("heard", b"cached", None)
    assert inbox.drain().samples["heard"].payload == b"new"


TOKEN = "heard/@adv/pub/n1/7/_"


def test_a_publisher_that_says_a_later_number_is_asked_for_what_was_lost(inbox: Inbox) -> None:
    def said(value: int) -> Collection[Cache]:
        inbox.last_number("heard", TOKEN, Number("n1/7", value))
        return inbox.drain().caches

    assert said(0) == [Cache("heard", TOKEN)], "its first message did not come"
    inbox.put("heard", b"true", Sent(1.0), Number("n1/7", NUMBERS - 1))
    assert said(NUMBERS - 1) == [], "nothing was lost"
    assert said(NUMBERS - 2) == [], "it was said late"
    assert said(0) == [Cache("heard", TOKEN, lost=True)], "after the largest number comes 0"
    inbox.put_cached("heard", b"false", Sent(1.5), Number("n1/7", 0))
    sample = inbox.drain().samples["heard"]
    assert (sample.payload, sample.cached) == (b"false", True)
    assert said(0) == []
    inbox.put("heard", b"true", Sent(2.0), Number("n1/7", 1))
    inbox.put_cached("heard", b"false", Sent(1.5), Number("n1/7", 0))
    assert inbox.drain().samples["heard"].payload == b"true", "it published while it was asked"
    inbox.publisher_lost("heard", "n1/7")
    assert said(5) == [Cache("heard", TOKEN)], "nothing is known of a publisher that came again"


def test_a_cache_is_delivered_once_and_at_once(inbox: Inbox, woken: list[bool]) -> None:
    inbox.cache("heard", "heard/@adv/pub/b1/uhlc/_")
    assert (inbox.drain().caches, woken) == ([Cache("heard", "heard/@adv/pub/b1/uhlc/_")], [True])
    assert inbox.drain().caches == []


def test_of_a_lossless_topic_each_change_in_between_is_kept(inbox: Inbox) -> None:
    for said in (b"yes", b"no", b"no", b"yes"):
        inbox.put("permit", said, None)
    sample = inbox.drain().samples["permit"]
    assert ([skipped.payload for skipped in sample.skipped_payloads], sample.overrun) == (
        [b"yes", b"no"],
        False,
    )
    assert sorted(skipped.at for skipped in sample.skipped_payloads) == [
        skipped.at for skipped in sample.skipped_payloads
    ]
    assert sample.skipped_payloads[-1].at <= sample.at


def test_overflow_of_changes_is_reported(inbox: Inbox) -> None:
    for number in range(UNSEEN_MOST + 1):
        inbox.put("permit", b"%d" % number, None)
    assert not inbox.drain().samples["permit"].overrun
    for number in range(UNSEEN_MOST + 2):
        inbox.put("permit", b"%d" % number, None)
    sample = inbox.drain().samples["permit"]
    assert [skipped.payload for skipped in sample.skipped_payloads] == [
        b"%d" % n for n in range(1, UNSEEN_MOST + 1)
    ]
    assert sample.overrun
    for number in range(5):
        inbox.put("permit", b"%d" % number * (UNSEEN_BYTES // 2), None)
    sample = inbox.drain().samples["permit"]
    assert (len(sample.skipped_payloads), sample.overrun) == (2, True)


def test_of_a_recorded_topic_every_sample_is_kept_in_order(inbox: Inbox) -> None:
    for number in range(3):
        inbox.put("taped", b"%d" % number, None)
        inbox.put("heard", b"x", None)
    changes = inbox.drain()
    assert [(key, kept.payload) for key, kept in changes.recorded_samples] == [
        ("taped", b"0"),
        ("taped", b"1"),
        ("taped", b"2"),
    ]
    assert list(inbox.drain().recorded_samples) == []


def test_of_a_changing_topic_each_change_is_kept_over_drains_too(inbox: Inbox) -> None:
    kept = []
    for said in (b"1", b"1", b"0", b"0", b"1"):
        inbox.put("guard", said, None)
        kept += [sample.payload for _, sample in inbox.drain().recorded_samples]
    assert kept == [b"1", b"0", b"1"]


def test_recorded_samples_are_bounded_in_number_and_bytes(inbox: Inbox) -> None:
    for number in range(KEPT_MOST + 10):
        inbox.put("taped", b"%d" % number, None)
    kept = list(inbox.drain().recorded_samples)
    assert (len(kept), kept[0][1].payload) == (KEPT_MOST, b"10")
    large = bytes(KEPT_BYTES // 4)
    for _ in range(10):
        inbox.put("taped", large, None)
    assert len(list(inbox.drain().recorded_samples)) == 4


def test_samples_of_a_closed_session_are_dropped(inbox: Inbox) -> None:
    old = inbox.guarded(lambda said: inbox.put("heard", said, None))
    inbox.put("heard", b"", None)
    inbox.transport("z", True)
    inbox.renew()
    old(b"late")
    changes = inbox.drain()
    assert (changes.samples, changes.link_up) == ({}, False)
    inbox.guarded(lambda said: inbox.put("heard", said, None))(b"new")
    assert inbox.drain().samples["heard"].payload == b"new"


def test_what_nobody_looks_at_wakes_nobody_and_waits_for_a_whole_drain(
    inbox: Inbox, woken: list[bool]
) -> None:
    inbox.set_idle({"heard"})
    for said in (b"one", b"two"):
        inbox.put("heard", said, None)
    assert (woken, inbox.has_idle) == ([], True)
    inbox.put("permit", b"true", None)
    assert list(inbox.drain(whole=False).samples) == ["permit"]
    sample = inbox.drain().samples["heard"]
    assert (sample.payload, sample.skipped, inbox.has_idle) == (b"two", 1, False)


@pytest.mark.parametrize(
    ("key", "frames", "name"),
    [
        ("unseen", 20, "wake-ups for 1,000 messages that no one looks at"),
        ("heard", 20, "wake-ups for 1,000 messages in 20 frames"),
        ("permit", 1000, "wake-ups for 1,000 permissions, a turn after each"),
    ],
)
def test_messages_wake_the_loop_no_more_often(
    inbox: Inbox, woken: list[bool], key: str, frames: int, name: str
) -> None:
    inbox.set_idle({"unseen"})
    for number in range(1000):
        inbox.put(key, b"%d" % number, None)
        if (number + 1) % (1000 // frames) == 0:
            inbox.drain(whole=False)
    check(name, len(woken))


@pytest.mark.parametrize("change", ["token", "transport", "cache"])
def test_a_change_of_the_graph_or_of_a_connection_takes_what_came_before_it(
    inbox: Inbox, change: str
) -> None:
    inbox.set_idle({"heard"})
    inbox.put("heard", b"before", None)
    changes = {
        "token": lambda: inbox.token("t", False),
        "transport": lambda: inbox.transport("z", False),
        "cache": lambda: inbox.cache("heard", "c"),
    }
    changes[change]()
    assert inbox.drain(whole=False).samples["heard"].payload == b"before"


def test_what_somebody_looks_at_again_is_drained_with_the_rest(inbox: Inbox, woken: list[bool]) -> None:
    inbox.set_idle({"heard"})
    inbox.put("heard", b"unseen", None)
    inbox.set_idle(())
    assert inbox.drain(whole=False).samples["heard"].payload == b"unseen"
    inbox.put("heard", b"seen", None)
    inbox.set_idle({"heard"})
    assert inbox.drain(whole=False).samples == {}
    assert inbox.drain().samples["heard"].payload == b"seen"
    assert woken == [False]

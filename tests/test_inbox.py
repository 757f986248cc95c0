"""What a link's threads put in, and what the event loop takes out: no Zenoh, no threads."""

from datetime import UTC, datetime
from typing import Any

import pytest

from app.inbox import BETWEEN_BYTES, BETWEEN_MOST, KEPT_BYTES, KEPT_MOST, Inbox


class Sent:
    """A time stamp of the clock of `source`."""

    def __init__(self, time: float, source: str = "b1") -> None:
        self.time = time
        self.source = source

    def __ge__(self, other: Any) -> bool:
        return bool(self.time >= other.time)

    def get_id(self) -> str:
        return self.source

    def get_time(self) -> datetime:
        return datetime.fromtimestamp(self.time, UTC)


@pytest.fixture
def woken() -> list[bool]:
    return []


@pytest.fixture
def inbox(woken: list[bool]) -> Inbox:
    """`permit` is watched, `status` prompt, and `taped` is kept whole."""
    mine = Inbox(woken.append)
    mine.expect(["status"], ["permit"], ["taped"])
    return mine


def test_of_a_topic_the_newest_is_kept_and_what_was_skipped_counted(inbox: Inbox) -> None:
    for said in (b"one", b"two", b"three"):
        inbox.put("heard", said, None)
    sample = inbox.drain().samples["heard"]
    assert (sample.payload, sample.skipped, sample.between) == (b"three", 2, ())
    assert inbox.drain().samples == {}


def test_a_sample_has_its_source_and_its_time_there(inbox: Inbox) -> None:
    inbox.put("heard", b"", Sent(7.5))
    inbox.put("unstamped", b"", None)
    samples = inbox.drain().samples
    assert (samples["heard"].source, samples["heard"].sent) == ("b1", None)  # asked for recordings only
    assert (samples["unstamped"].source, samples["unstamped"].sent) == (None, None)


def test_values_wake_the_loop_once_until_they_are_taken(inbox: Inbox, woken: list[bool]) -> None:
    for _ in range(1000):
        inbox.put("heard", b"", None)
    assert woken == [False]
    inbox.drain()
    inbox.put("heard", b"", None)
    assert woken == [False, False]


@pytest.mark.parametrize("key", ["permit", "status"])
def test_what_is_prompt_waits_for_no_value(inbox: Inbox, woken: list[bool], key: str) -> None:
    inbox.put("heard", b"", None)
    inbox.put(key, b"", None)
    inbox.put(key, b"", None)
    inbox.put("heard", b"", None)
    assert woken == [False, True]


def test_the_graph_and_the_link_are_prompt(inbox: Inbox, woken: list[bool]) -> None:
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
    assert changes.samples["before"].seq < token.lost_seq < changes.samples["after"].seq


def test_history_that_comes_after_what_is_newer_is_passed_over(inbox: Inbox) -> None:
    inbox.put("heard", b"new", Sent(2.0))
    inbox.put("heard", b"old", Sent(1.0))
    assert inbox.drain().samples["heard"].payload == b"new"
    inbox.put("heard", b"of another clock", Sent(1.0, "b2"))
    assert inbox.drain().samples["heard"].payload == b"of another clock"


def test_of_a_watched_topic_each_change_in_between_is_kept(inbox: Inbox) -> None:
    for said in (b"yes", b"no", b"no", b"yes"):
        inbox.put("permit", said, None)
    sample = inbox.drain().samples["permit"]
    assert ([one.payload for one in sample.between], sample.overrun) == ([b"yes", b"no"], False)
    assert sorted(one.at for one in sample.between) == [one.at for one in sample.between]
    assert sample.between[-1].at <= sample.at


def test_of_too_many_changes_it_is_said_that_some_are_not_known(inbox: Inbox) -> None:
    for number in range(BETWEEN_MOST + 1):
        inbox.put("permit", b"%d" % number, None)
    assert not inbox.drain().samples["permit"].overrun
    for number in range(BETWEEN_MOST + 2):
        inbox.put("permit", b"%d" % number, None)
    sample = inbox.drain().samples["permit"]
    assert [one.payload for one in sample.between] == [b"%d" % n for n in range(1, BETWEEN_MOST + 1)]
    assert sample.overrun
    for number in range(5):
        inbox.put("permit", b"%d" % number * (BETWEEN_BYTES // 2), None)
    sample = inbox.drain().samples["permit"]
    assert (len(sample.between), sample.overrun) == (2, True)


def test_what_is_kept_whole_has_every_sample_in_order(inbox: Inbox) -> None:
    for number in range(3):
        inbox.put("taped", b"%d" % number, None)
        inbox.put("heard", b"x", None)
    changes = inbox.drain()
    assert [(key, one.payload) for key, one in changes.kept] == [
        ("taped", b"0"),
        ("taped", b"1"),
        ("taped", b"2"),
    ]
    assert list(inbox.drain().kept) == []


def test_what_is_kept_whole_is_bounded_by_its_number_and_its_bytes(inbox: Inbox) -> None:
    for number in range(KEPT_MOST + 10):
        inbox.put("taped", b"%d" % number, None)
    kept = list(inbox.drain().kept)
    assert (len(kept), kept[0][1].payload) == (KEPT_MOST, b"10")
    large = bytes(KEPT_BYTES // 4)
    for _ in range(10):
        inbox.put("taped", large, None)
    assert len(list(inbox.drain().kept)) == 4


def test_of_a_session_that_was_nothing_comes_in(inbox: Inbox) -> None:
    old = inbox.guarded(lambda said: inbox.put("heard", said, None))
    inbox.put("heard", b"", None)
    inbox.transport("z", True)
    inbox.renew()
    old(b"late")
    changes = inbox.drain()
    assert (changes.samples, changes.link_up) == ({}, False)
    inbox.guarded(lambda said: inbox.put("heard", said, None))(b"new")
    assert inbox.drain().samples["heard"].payload == b"new"

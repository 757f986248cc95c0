"""One heartbeat for all streams: its timer, what it says, and when it goes along with news."""

import asyncio
import json
import re
from collections.abc import Awaitable, Callable

import pytest

from app.cell.view import publisher
from app.cell.view.publisher import Heartbeat, beat
from app.system import clock
from tests.support.parts import events_in
from tests.support.waiting import pass_time


def run(work: Callable[[], Awaitable[None]]) -> None:
    async def whole() -> None:
        async with asyncio.timeout(10):
            await work()

    asyncio.run(whole())


class Beating:
    """A heartbeat, and a wait for the next beats of its own accord."""

    def __init__(self) -> None:
        self.woken = asyncio.Event()
        self.heart = Heartbeat(self.woken.set)

    async def next(self) -> None:
        self.woken.clear()
        await self.woken.wait()


def test_heartbeat_has_the_time_and_no_id() -> None:
    before = clock.server_now()
    ((name, data, event_id),) = events_in(beat().decode())
    beats = json.loads(data)
    assert (name, event_id) == ("beat", "")
    assert re.fullmatch(r"\d\d:\d\d:\d\d", beats["clock"])
    assert round(before * 1000) <= beats["now"] <= round(clock.server_now() * 1000)


def test_heartbeat_runs_while_a_listener_is_connected(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(publisher, "BEAT_S", 0.01)

    async def work() -> None:
        beating = Beating()
        with beating.heart.heard():
            for count in (1, 2, 3):
                await beating.next()
                assert beating.heart.count == count

    run(work)


def test_all_heartbeat_listeners_get_the_same_bytes_of_one_timer(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(publisher, "BEAT_S", 0.01)

    async def work() -> None:
        beating = Beating()
        with beating.heart.heard(), beating.heart.heard(), beating.heart.heard():
            await beating.next()
            assert beating.heart.count == 1
            assert events_in(beating.heart.event().decode())[0][0] == "beat"

    run(work)


def test_heartbeat_timer_ends_with_its_last_listener() -> None:
    async def work() -> None:
        beating = Beating()
        with beating.heart.heard():
            with beating.heart.heard():
                pass
            assert beating.heart._timer is not None
        assert beating.heart._timer is None
        with beating.heart.heard():
            assert beating.heart._timer is not None

    run(work)


def test_a_beat_that_is_nearly_due_goes_along_and_wakes_no_stream_itself() -> None:
    async def work() -> None:
        beating = Beating()
        with beating.heart.heard():
            beating.heart.beat_early()
            assert beating.heart.count == 0  # it is not due yet
            await pass_time(publisher.BEAT_S - publisher.EARLY_S + 0.01)
            beating.heart.beat_early()
            assert not beating.woken.is_set()
            assert beating.heart.count == 1
            beating.heart.beat_early()
            assert beating.heart.count == 1

    run(work)


def test_without_a_listener_none_goes_along() -> None:
    async def work() -> None:
        beating = Beating()
        beating.heart.beat_early()
        assert beating.heart.count == 0

    run(work)

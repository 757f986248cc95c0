"""Delays after failed sign-ins, by an injected clock."""

import random
from dataclasses import dataclass

import pytest

from app.cell.people.access import (
    ADDRESS,
    BADGE_HERE,
    MAX_BUCKETS,
    USER,
    USER_ANYWHERE,
    Guessed,
    SignInDelays,
)

pytestmark = pytest.mark.promise("users")

HERE = "127.0.0.1"
AWAY = "10.0.0.9"
SHIFT_S = 8 * 3600


@dataclass
class Clock:
    now: float = 1000.0

    def __call__(self) -> float:
        return self.now


def failing(delays: SignInDelays, count: int, user: str = "Sato", address: str = HERE) -> None:
    for _ in range(count):
        delays.failed(user, address, address == HERE)


def wait_s(delays: SignInDelays, user: str = "Sato", address: str = HERE) -> int:
    return delays.wait_s(user, address, address == HERE)


@pytest.mark.parametrize(
    ("failures", "seconds", "left"),
    [(0, 0, 5), (1, 0, 4), (4, 0, 1), (5, 30, 1), (6, 60, 1), (7, 120, 1), (9, 480, 1), (30, 900, 1)],
)
def test_the_delay_grows_with_each_failure_up_to_a_limit(
    failures: int, seconds: int, left: int
) -> None:
    delays = SignInDelays(Clock())
    failing(delays, failures)
    assert (wait_s(delays), delays.tries_left("Sato", HERE, True)) == (seconds, left)


def test_a_stranger_elsewhere_does_not_delay_the_panel_at_the_cell() -> None:
    delays = SignInDelays(Clock())
    failing(delays, 100, address=AWAY)
    assert wait_s(delays, address=AWAY) == USER_ANYWHERE.longest_s
    assert wait_s(delays) == 0
    assert delays.tries_left("Sato", HERE, True) == USER.free


def test_an_address_that_tries_many_users_is_delayed_for_all() -> None:
    delays = SignInDelays(Clock())
    for number in range(ADDRESS.free):
        failing(delays, 1, f"user {number}", AWAY)
    assert wait_s(delays, "another", AWAY) == 30
    assert wait_s(delays, "another") == 0


def test_at_the_kiosk_one_who_errs_delays_no_other() -> None:
    delays = SignInDelays(Clock())
    for number in range(100):
        failing(delays, 4, f"user {number}")
        failing(delays, 1, "")
    assert wait_s(delays, "another") == wait_s(delays, "user 7") == 0


def test_an_unknown_badge_delays_the_next_badge_by_seconds_only() -> None:
    clock = Clock()
    delays = SignInDelays(clock)
    failing(delays, BADGE_HERE.free, "")
    assert (wait_s(delays, ""), wait_s(delays)) == (BADGE_HERE.first_s, 0)
    failing(delays, 100, "")
    assert (wait_s(delays, ""), wait_s(delays)) == (BADGE_HERE.longest_s, 0)
    clock.now += BADGE_HERE.longest_s
    assert wait_s(delays, "") == 0


def test_a_secret_that_is_tried_from_many_addresses_is_delayed_for_all_of_them() -> None:
    delays = SignInDelays(Clock())
    delays.succeeded("Sato", "10.0.1.1", False)
    for number in range(USER_ANYWHERE.free // 2):
        failing(delays, 2, "Sato", f"10.0.0.{number}")
    assert wait_s(delays, "sato", "10.0.0.99") == USER_ANYWHERE.first_s
    assert wait_s(delays, "Weber", "10.0.0.99") == 0
    # Where the user has signed in before, and at the panel itself, nothing waits.
    assert wait_s(delays, "Sato", "10.0.1.1") == wait_s(delays, "Sato") == 0
    assert delays.guessed == Guessed("sato", tuple(f"10.0.0.{number}" for number in range(10)))


def test_what_is_tried_at_the_kiosk_or_seldom_is_not_told() -> None:
    clock = Clock()
    delays = SignInDelays(clock)
    failing(delays, 100)
    failing(delays, 100, "")
    failing(delays, 3, address=AWAY)
    assert delays.guessed is None
    for number in range(ADDRESS.free):
        failing(delays, 1, f"user {number}", AWAY)
    assert delays.guessed == Guessed("", (AWAY,))
    clock.now += 4 * ADDRESS.leak_s
    assert delays.guessed is None


def test_another_way_to_write_a_name_is_the_same_user() -> None:
    delays = SignInDelays(Clock())
    failing(delays, 3, "MÜLLER")
    failing(delays, 2, "mu\u0308ller")
    assert wait_s(delays, "Müller") == 30


def test_a_delay_ends_and_one_more_failure_doubles_it() -> None:
    clock = Clock()
    delays = SignInDelays(clock)
    failing(delays, USER.free)
    clock.now += 29.5
    assert wait_s(delays) == 1
    clock.now += 0.5
    assert wait_s(delays) == 0
    failing(delays, 1)
    assert wait_s(delays) == 60


def test_failures_of_some_seconds_count_whole() -> None:
    clock = Clock()
    delays = SignInDelays(clock)
    for _ in range(USER.free):
        failing(delays, 1)
        clock.now += 2
    assert wait_s(delays) == 28


def test_a_success_forgets_the_failures_of_this_user_only() -> None:
    delays = SignInDelays(Clock())
    failing(delays, USER.free)
    failing(delays, USER.free, "Weber")
    delays.succeeded("Sato", HERE, True)
    assert (wait_s(delays), wait_s(delays, "Weber")) == (0, 30)


def test_failures_leak_one_by_one() -> None:
    clock = Clock()
    delays = SignInDelays(clock)
    failing(delays, 4)
    for left in (1, 2, 3, 4, 5):
        assert delays.tries_left("Sato", HERE, True) == left
        clock.now += USER.leak_s


def test_what_waits_is_kept_however_many_fail_elsewhere() -> None:
    clock = Clock()
    delays = SignInDelays(clock)
    failing(delays, 7)
    for number in range(2 * MAX_BUCKETS):
        clock.now += 0.01
        failing(
            delays, 1, f"user {number}", f"10.{number // 65536}.{number // 256 % 256}.{number % 256}"
        )
    assert wait_s(delays) > 0


def test_a_month_of_typos_locks_nobody_out() -> None:
    """60 users in three shifts: each signs in ten times in a shift and errs in one of ten tries, three
    badges of a hundred are misread, and now and then somebody looks for the right PIN for long."""
    chance, clock = random.Random(41), Clock()
    delays = SignInDelays(clock)
    longest = {"": 0, "typos": 0}
    for _ in range(30 * 3):
        shift, start = [f"user {number}" for number in range(20)], clock.now
        seeker = chance.choice(shift)
        tries = sorted((start + chance.random() * SHIFT_S, user) for user in shift * 10)
        for at, user in tries:
            clock.now = max(clock.now, at)
            if chance.random() < 0.3:
                longest[""] = max(longest[""], wait_s(delays, ""))
                clock.now += wait_s(delays, "")
                (delays.failed if chance.random() < 0.03 else delays.succeeded)("", HERE, True)
            if user == seeker:
                failing(delays, 1, seeker)
                continue
            longest["typos"] = max(longest["typos"], wait_s(delays, user))
            while chance.random() < 0.1:
                failing(delays, 1, user)
            delays.succeeded(user, HERE, True)
        clock.now = start + SHIFT_S
    assert longest["typos"] == 0
    assert longest[""] <= BADGE_HERE.longest_s

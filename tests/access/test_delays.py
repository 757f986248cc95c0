"""Delays after failed sign-ins, by an injected clock."""

from dataclasses import dataclass

import pytest

from app.access.delays import ADDRESS_TRIES, FREE_TRIES, LONGEST_DELAY_S, SignInDelays

HERE = "127.0.0.1"
AWAY = "10.0.0.9"


@dataclass
class Clock:
    now: float = 1000.0

    def __call__(self) -> float:
        return self.now


def failing(delays: SignInDelays, count: int, user: str = "Sato", address: str = HERE) -> None:
    for _ in range(count):
        delays.failed(user, address)


@pytest.mark.parametrize(
    ("failures", "wait_s", "left"),
    [(0, 0, 5), (1, 0, 4), (4, 0, 1), (5, 30, 1), (6, 60, 1), (7, 120, 1), (9, 480, 1), (30, 900, 1)],
)
def test_the_delay_grows_with_each_failure_up_to_a_limit(failures: int, wait_s: int, left: int) -> None:
    delays = SignInDelays(Clock())
    failing(delays, failures)
    assert (delays.wait_s("Sato", HERE), delays.tries_left("Sato", HERE)) == (wait_s, left)


def test_a_stranger_elsewhere_does_not_delay_the_panel_at_the_cell() -> None:
    delays = SignInDelays(Clock())
    failing(delays, 100, address=AWAY)
    assert delays.wait_s("Sato", AWAY) == LONGEST_DELAY_S
    assert delays.wait_s("Sato", HERE) == 0
    assert delays.tries_left("Sato", HERE) == FREE_TRIES


def test_an_address_that_tries_many_users_is_delayed_for_all() -> None:
    delays = SignInDelays(Clock())
    for number in range(ADDRESS_TRIES):
        delays.failed(f"user {number}", AWAY)
    assert delays.wait_s("another", AWAY) == 30
    assert delays.wait_s("another", HERE) == 0


def test_another_way_to_write_a_name_is_the_same_user() -> None:
    delays = SignInDelays(Clock())
    failing(delays, 3, "SATO")
    failing(delays, 2, "sato")
    assert delays.wait_s("Sato", HERE) == 30


def test_a_delay_ends_and_one_more_failure_doubles_it() -> None:
    clock = Clock()
    delays = SignInDelays(clock)
    failing(delays, FREE_TRIES)
    clock.now += 29.5
    assert delays.wait_s("Sato", HERE) == 1
    clock.now += 0.5
    assert delays.wait_s("Sato", HERE) == 0
    failing(delays, 1)
    assert delays.wait_s("Sato", HERE) == 60


def test_a_success_forgets_the_failures_of_this_user_only() -> None:
    delays = SignInDelays(Clock())
    failing(delays, FREE_TRIES)
    failing(delays, FREE_TRIES, "Weber")
    delays.succeeded("Sato", HERE)
    assert (delays.wait_s("Sato", HERE), delays.wait_s("Weber", HERE)) == (0, 30)


def test_failures_are_forgotten_after_an_hour_without_one() -> None:
    clock = Clock()
    delays = SignInDelays(clock)
    failing(delays, 8)
    clock.now += 3601
    assert (delays.wait_s("Sato", HERE), delays.tries_left("Sato", HERE)) == (0, FREE_TRIES)

"""How often someone may do something, by a clock that the test sets."""

import pytest

from app.cell.commands.judge import PressLimits
from app.cell.permission.client_limits import RATE_LIMITS
from app.records import Origin
from app.records.principal import Client, Principal, anonymous
from app.system.limits import MAX_BUCKETS, Quota, TokenBuckets

AT_THE_CELL = "127.0.0.1"
CLIENT_QUOTA, ADDRESS_QUOTA, TOTAL_QUOTA, CANCEL_QUOTA = (
    RATE_LIMITS[name].quota for name in ("presses", "address_presses", "other_presses", "cancels")
)


class Pressing:
    """Presses of any client, at the time `now`."""

    def __init__(self) -> None:
        self.now = 0.0
        self.left_out: list[Origin] = []
        self.limits = PressLimits(self.left_out.append, lambda: self.now)

    def admitted(self, who: Principal, times: int) -> int:
        return sum(self.limits.admit(who) for _ in range(times))

    def canceled(self, who: Principal, times: int, *goal: str) -> int:
        return sum(self.limits.admit_cancel(who, *goal) for _ in range(times))


@pytest.fixture
def pressing() -> Pressing:
    return Pressing()


def program(address: str) -> Principal:
    return Principal(anonymous(address))


def browser(number: int, address: str = "10.0.0.7") -> Principal:
    return Principal(Client(f"b{number}", address, address == AT_THE_CELL, number))


def test_so_many_at_once_and_then_so_many_a_second() -> None:
    now = 0.0
    buckets = TokenBuckets(Quota(10, 2), lambda: now)

    def taken(key: str) -> int:
        count = 0
        while buckets.has_token(key):
            buckets.take_token(key)
            count += 1
        return count

    assert (taken("a"), taken("b")) == (10, 10)
    now = 1.4
    assert (taken("a"), taken("a")) == (2, 0)
    now = 1.5
    assert taken("a") == 1
    now = 1e6
    assert taken("a") == 10


def test_only_the_latest_clients_are_remembered() -> None:
    buckets = TokenBuckets(Quota(1, 1), lambda: 0.0)
    for key in range(10 * MAX_BUCKETS):
        buckets.take_token(key)
    assert len(buckets._buckets) == MAX_BUCKETS
    assert not buckets.has_token(10 * MAX_BUCKETS - 1)
    assert buckets.has_token(0)


def test_a_client_has_its_limit_and_takes_nothing_from_another(pressing: Pressing) -> None:
    assert pressing.admitted(browser(1), 1000) == CLIENT_QUOTA.burst
    assert pressing.admitted(browser(2), 10) == 10
    pressing.now += 10
    assert pressing.admitted(browser(1), 1000) == CLIENT_QUOTA.burst
    pressing.now += 0.5
    assert pressing.admitted(browser(1), 1000) == CLIENT_QUOTA.per_s / 2


def test_in_the_long_run_no_more_than_its_rate_is_admitted(pressing: Pressing) -> None:
    admitted = 0
    for _ in range(9240):  # a press each millisecond or so
        pressing.now += 1 / 924
        admitted += pressing.limits.admit(browser(1))
    assert admitted <= CLIENT_QUOTA.burst + 10 * CLIENT_QUOTA.per_s


def test_invented_cookies_share_the_limit_of_their_address(pressing: Pressing) -> None:
    assert sum(pressing.admitted(browser(n), 10) for n in range(1000)) == ADDRESS_QUOTA.burst
    assert pressing.admitted(browser(1, "10.0.0.8"), 10) == 10


def test_programs_without_a_cookie_are_one_client(pressing: Pressing) -> None:
    assert pressing.admitted(program("10.0.0.7"), 1000) == CLIENT_QUOTA.burst
    assert pressing.admitted(browser(1), 10) == 10


def test_a_whole_network_has_a_limit_and_leaves_the_cell_its_own(pressing: Pressing) -> None:
    assert sum(pressing.admitted(program(f"10.0.1.{n}"), 50) for n in range(250)) == TOTAL_QUOTA.burst
    assert pressing.admitted(browser(1, AT_THE_CELL), 10) == 10


def test_each_that_is_too_many_is_counted_and_logged(pressing: Pressing) -> None:
    too_many = 1000 - pressing.admitted(browser(1), 1000)
    assert pressing.limits.refused == too_many == len(pressing.left_out)
    assert (pressing.left_out[0].browser, pressing.left_out[0].who) == ("b1", "Panel 1")


def test_a_cancel_is_one_too_many_only_if_this_goals_was_asked_for_just_now(pressing: Pressing) -> None:
    """No press, no other goal and no one else's cancels keep anyone from stopping a robot."""
    pressing.admitted(browser(1), 1000)
    sum(pressing.admitted(program(f"10.0.1.{n}"), 50) for n in range(250))
    assert pressing.canceled(browser(1), 1000, "/robots/r1", "count", "p1") == CANCEL_QUOTA.burst
    assert pressing.canceled(browser(1), 3, "/robots/r1", "count", "p2") == 3
    assert pressing.canceled(browser(1), 3, "/robots/r2", "count", "p1") == 3
    pressing.now += 1
    assert pressing.canceled(browser(2), 1000, "/robots/r1", "count", "p1") == CANCEL_QUOTA.per_s

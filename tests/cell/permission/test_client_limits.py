"""Each row of the table of limits."""

import pytest

from app.cell.permission.client_limits import PLACE_LIMITS, RATE_LIMITS, RateGuard
from app.system.texts import render, say


@pytest.mark.parametrize("name", RATE_LIMITS)
def test_over_a_limit_is_refused_until_there_is_room_and_no_one_else_is(name: str) -> None:
    limit, now = RATE_LIMITS[name], 0.0
    guard = RateGuard(name, monotonic=lambda: now)

    def admitted(key: str, of_kiosk: bool = False) -> int:
        tries = int(limit.quota.burst) + 10
        return sum(guard.exceeded(of_kiosk, **{name: key}) is None for _ in range(tries))

    assert admitted("one") == limit.quota.burst
    assert guard.exceeded(False, **{name: "one"}) is limit
    assert guard.exceeded(False, **{name: "another"}) is None
    assert (guard.exceeded(True, **{name: "one"}) is None) == limit.exempts_kiosk
    now = limit.retry_after_s
    assert guard.exceeded(False, **{name: "one"}) is None
    error = limit.error
    assert (error.status, error.retry_after_s) == (429, limit.retry_after_s)
    assert all(render(say(limit.sentence), language) for language in ("en", "ja", "de"))


def test_what_one_limit_refuses_counts_for_no_other() -> None:
    guard = RateGuard("presses", "address_presses", monotonic=lambda: 0.0)
    presses, address = (RATE_LIMITS[name].quota for name in ("presses", "address_presses"))
    for client in range(int(address.burst / presses.burst)):
        for _ in range(int(presses.burst)):
            assert guard.exceeded(False, presses=client, address_presses="10.0.0.7") is None
        refused = guard.exceeded(False, presses=client, address_presses="10.0.0.8")
        assert refused is RATE_LIMITS["presses"]
    assert guard.exceeded(False, presses="new", address_presses="10.0.0.7") is not None
    assert guard.exceeded(False, presses="new", address_presses="10.0.0.8") is None


@pytest.mark.parametrize("name", PLACE_LIMITS)
def test_places_are_kept_for_the_kiosk_and_for_others(name: str) -> None:
    places = PLACE_LIMITS[name].places
    assert places.client < places.others < places.total
    assert places.client <= places.kiosk

"""How many things each client may have open."""

import pytest

from app.cell.permission.client_places import ClientPlaces, PlaceLimits, client_key, shares
from app.web.server import NamedProxies

LIMITS = PlaceLimits(total=10, others=8, client=3, kiosk=5)
KIOSK = "127.0.0.1"


def taken(places: ClientPlaces, client: str, tries: int = 20) -> int:
    """How many places the client gets."""
    got = 0
    for _ in range(tries):
        if places.has_place(client):
            places.take(client)
            got += 1
    return got


def test_no_number_of_other_clients_takes_the_places_of_the_kiosk() -> None:
    places = ClientPlaces(LIMITS)
    assert [taken(places, f"192.0.2.{number}") for number in range(5)] == [3, 3, 2, 0, 0]
    assert taken(places, KIOSK) == 2


def test_the_kiosk_leaves_places_for_others() -> None:
    places = ClientPlaces(LIMITS)
    assert taken(places, KIOSK) == 5
    assert [taken(places, f"192.0.2.{number}") for number in range(3)] == [3, 2, 0]


def test_a_proxy_is_many_clients() -> None:
    proxies = NamedProxies()
    proxies.name(["192.0.2.9", "198.51.100.0/24", "2001:db8::1"])
    places = ClientPlaces(LIMITS, proxies)
    assert taken(places, "192.0.2.1") == LIMITS.client
    assert taken(places, "192.0.2.9") == LIMITS.others - LIMITS.client
    addresses = (
        "198.51.100.7",
        client_key("2001:db8::1"),
        "192.0.2.8",
        "2001:db9::/64",
        "not an address",
    )
    assert [proxies(address) for address in addresses] == [True, True, False, False, False]


def test_a_place_that_is_given_back_can_be_taken_again() -> None:
    places = ClientPlaces(LIMITS)
    assert taken(places, "192.0.2.1") == 3
    places.release("192.0.2.1")
    assert places.has_place("192.0.2.1")
    assert taken(places, "192.0.2.1") == 1


def test_released_places_are_free_for_all_and_leave_no_client_behind() -> None:
    places = ClientPlaces(LIMITS)
    assert places.empty
    for number in range(8):
        places.take(f"192.0.2.{number}")
    assert places.full("192.0.2.9")
    assert not places.empty
    for number in range(8):
        places.release(f"192.0.2.{number}")
    assert places.empty
    assert not places._taken
    assert [taken(places, f"192.0.2.{number}") for number in range(3)] == [3, 3, 2]


def test_a_refused_client_learns_the_limit_that_it_has_reached() -> None:
    places = ClientPlaces(LIMITS)
    assert taken(places, "192.0.2.1") == 3
    assert places.most("192.0.2.1") == LIMITS.client
    assert places.most("192.0.2.2") == LIMITS.others
    assert places.most(KIOSK) == LIMITS.total


@pytest.mark.parametrize("total", [1, 2, 3, 10, 20, 32, 824, 2000])
def test_shares_fit_into_the_total(total: int) -> None:
    limits = shares(total)
    assert 1 <= limits.client <= limits.others <= limits.total == total
    assert 1 <= limits.kiosk <= total
    assert total == 1 or limits.others < total


@pytest.mark.parametrize(
    ("address", "key"),
    [
        ("192.0.2.7", "192.0.2.7"),
        ("::ffff:192.0.2.7", "192.0.2.7"),
        ("::1", "::1"),
        ("::ffff:127.0.0.1", "127.0.0.1"),
        ("127.0.0.2", "127.0.0.2"),
        ("2001:db8::1", "2001:db8::/64"),
        ("2001:db8::ffff:1", "2001:db8::/64"),
        ("fe80::1%eth0", "fe80::1"),
        ("", "127.0.0.1"),
        ("not an address", "not an address"),
    ],
)
def test_a_client_is_an_address_and_of_ipv6_a_subnet(address: str, key: str) -> None:
    assert client_key(address) == key

"""Browsers are identified by their tokens, and named so that an operator knows which is meant."""

import pytest

from app.records.principal import (
    BROWSERS_KEPT,
    TOKEN,
    Clients,
    anonymous,
    new_client,
    new_token,
    public_id,
)
from tests.support.words import english


def token(number: int) -> str:
    return f"{number:032x}"


def test_a_token_is_random_and_long() -> None:
    tokens = {new_token() for _ in range(100)}
    assert len(tokens) == 100
    assert all(TOKEN.fullmatch(token) for token in tokens)


def test_public_id_differs_from_the_token_and_is_stable() -> None:
    first = Clients().identify(token(1), "192.0.2.7")
    again = Clients().identify(token(1), "192.0.2.7")
    assert first.id == again.id == public_id(token(1))
    assert first.id not in token(1)
    assert public_id(token(2)) != first.id


def test_browsers_are_numbered_as_they_come() -> None:
    browsers = Clients()
    names = [browsers.identify(token(n), "192.0.2.7").name for n in (1, 2, 1, 3)]
    assert english(names) == ["Panel 1", "Panel 2", "Panel 1", "Panel 3"]


def test_the_name_in_a_sentence_has_the_address_of_another_machine() -> None:
    browsers = Clients()
    far = browsers.identify(token(1), "192.0.2.7")
    near = browsers.identify(token(2), "127.0.0.1")
    more = browsers.identify(token(3), "::1")
    assert (str(far.title), str(far)) == ("Panel 1 (192.0.2.7)", "Panel 1 (192.0.2.7)")
    assert (str(near.title), str(near)) == (
        "The panel at the cell",
        "the panel at the cell (127.0.0.1)",
    )
    assert str(more.title) == "Browser 2 at the cell"


@pytest.mark.parametrize(
    ("address", "local", "shown"),
    [
        ("127.0.0.1", True, "127.0.0.1"),
        ("127.8.8.8", True, "127.8.8.8"),
        ("::1", True, "::1"),
        ("::ffff:127.0.0.1", True, "127.0.0.1"),
        ("::ffff:192.0.2.7", False, "192.0.2.7"),
        ("192.0.2.7", False, "192.0.2.7"),
        ("0.0.0.0", False, "0.0.0.0"),
        ("fe80::1%eth0", False, "fe80::1"),
        ("2001:db8::7", False, "2001:db8::7"),
        ("localhost", False, "unknown"),
        ("127.0.0.1.evil.example", False, "unknown"),
        ("<script>", False, "unknown"),
        ("", False, "unknown"),
    ],
)
def test_only_loopback_is_at_the_cell(address: str, local: bool, shown: str) -> None:
    for browser in (Clients().identify(token(1), address), anonymous(address)):
        assert (browser.local, browser.address) == (local, shown)


def test_a_token_that_is_carried_to_another_machine_is_no_longer_at_the_cell() -> None:
    browsers = Clients()
    assert browsers.identify(token(1), "127.0.0.1").local
    moved = browsers.identify(token(1), "192.0.2.7")
    assert (moved.local, str(moved.name)) == (False, "Panel 1")


def test_client_with_a_new_address_keeps_its_name() -> None:
    browsers = Clients()
    browsers.identify(token(1), "192.0.2.1")
    browsers.identify(token(2), "192.0.2.2")
    assert str(browsers.identify(token(2), "192.0.2.9")) == "Panel 2 (192.0.2.9)"


def test_those_not_seen_for_longest_are_forgotten_and_their_numbers_free() -> None:
    browsers = Clients()
    for number in range(BROWSERS_KEPT):
        browsers.identify(token(number), "192.0.2.7")
    browsers.identify(token(0), "192.0.2.7")
    assert browsers.identify(token(9999), "192.0.2.7").number == BROWSERS_KEPT + 1
    assert browsers.identify(token(9998), "192.0.2.7").number == 2
    assert browsers.identify(token(0), "192.0.2.7").number == 1


def test_client_that_does_not_return_takes_no_number() -> None:
    browsers = Clients()
    first = new_client(token(1), "192.0.2.7")
    assert (first.id, first.local) == (public_id(token(1)), False)
    assert browsers.identify(token(2), "192.0.2.7").number == 1


def test_a_stranger_has_no_id() -> None:
    assert (anonymous("192.0.2.7").id, str(anonymous("192.0.2.7"))) == ("", "a program (192.0.2.7)")


def test_requests_without_a_known_token_have_no_number() -> None:
    assert anonymous("192.0.2.7").number == new_client(token(1), "192.0.2.7").number == 0
    assert len(public_id(token(1))) == 12


def test_a_program_has_a_title_with_its_address_also_at_the_cell() -> None:
    assert str(anonymous("192.0.2.7").title) == "A program (192.0.2.7)"
    assert str(anonymous("127.0.0.1").title) == "A program (127.0.0.1)"


def test_a_browser_that_moves_off_the_cell_gets_a_free_number() -> None:
    browsers = Clients()
    browsers.identify(token(1), "192.0.2.7")
    assert browsers.identify(token(2), "127.0.0.1").number == 1
    assert browsers.identify(token(2), "192.0.2.8").number == 2
    assert browsers.identify(token(2), "192.0.2.9").number == 2

"""Changes of users and tokens: what they do, and what they refuse."""

from collections.abc import Callable

import pytest

from app.cell.people.edits import (
    add_token,
    add_user,
    hashes_of,
    keeps_engineer,
    remove_user,
    revoke_token,
    set_disabled,
    set_role,
    set_secrets,
)
from app.cell.people.secrets_hash import Cost, badge_hash
from app.cell.people.users import MOST_USERS, User, UserBook, UsersError
from app.panel.roles import ENGINEER, OPERATOR
from app.system.texts import Text

NOW = "2026-11-27T08:00:00+00:00"
QUICK = Cost(8, 1)
Change = Callable[[UserBook], UserBook]


def book() -> UserBook:
    users = UserBook()
    badge = badge_hash("04A2", users.badge_salt)
    sato = User("M. Sato", OPERATOR, ("quality",), pin="hash", badge=badge)
    users = users.with_user(sato, "then").with_user(User("J. Brandt", ENGINEER, pin="hash"), "then")
    return add_token(users, "line", OPERATOR, "hash", "then")


def code_of(error: UsersError) -> str:
    assert isinstance(error.text, Text)
    return error.text.code


@pytest.mark.parametrize(
    ("change", "code"),
    [
        (lambda b: add_user(b, "A", OPERATOR, (), {}, NOW), "users_no_way"),
        (lambda b: add_user(b, "m. sato", OPERATOR, (), {"pin": "h"}, NOW), "users_exists"),
        (lambda b: add_user(b, "M. Sat0", OPERATOR, (), {"pin": "h"}, NOW), "users_name_alike"),
        (lambda b: add_user(b, "M. Sаto", OPERATOR, (), {"pin": "h"}, NOW), "users_name_mixed"),
        (lambda b: add_token(b, "Iine", OPERATOR, "h", NOW), "users_name_alike"),
        (lambda b: add_user(b, " A", OPERATOR, (), {"pin": "h"}, NOW), "users_name_of_user"),
        (lambda b: add_user(b, "A", "boss", (), {"pin": "h"}, NOW), "users_role_unknown"),
        (lambda b: add_user(b, "A", OPERATOR, ("Q",), {"pin": "h"}, NOW), "users_group_form"),
        (lambda b: set_role(b, "Nobody", OPERATOR, None, NOW), "users_unknown"),
        (lambda b: set_role(b, "M. Sato", "boss", None, NOW), "users_role_unknown"),
        (lambda b: set_secrets(b, "J. Brandt", {"pin": ""}, NOW), "users_last_way"),
        (lambda b: remove_user(b, "Nobody"), "users_unknown"),
        (lambda b: add_token(b, "line", OPERATOR, "h", NOW), "users_token_exists"),
        (lambda b: add_token(b, "", OPERATOR, "h", NOW), "users_name_of_token"),
        (lambda b: revoke_token(b, "other"), "users_token_unknown"),
        (lambda b: keeps_engineer(b, remove_user(b, "J. Brandt")), "users_last_engineer"),
        (lambda b: keeps_engineer(b, set_disabled(b, "J. Brandt", True, NOW)), "users_last_engineer"),
        (
            lambda b: keeps_engineer(b, set_role(b, "J. Brandt", OPERATOR, None, NOW)),
            "users_last_engineer",
        ),
    ],
)
def test_a_change_that_can_not_be_made_says_why(change: Change, code: str) -> None:
    with pytest.raises(UsersError) as refused:
        change(book())
    assert code_of(refused.value) == code


def test_a_badge_has_one_user() -> None:
    with pytest.raises(UsersError) as refused:
        hashes_of({"badge": "04A2"}, book(), "J. Brandt", QUICK)
    assert code_of(refused.value) == "users_badge_taken"
    assert hashes_of({"badge": "04A2"}, book(), "m. sato", QUICK)


def test_the_first_user_is_an_engineer() -> None:
    empty = UserBook()
    with pytest.raises(UsersError) as refused:
        keeps_engineer(empty, add_user(empty, "A", OPERATOR, (), {"pin": "h"}, NOW))
    assert code_of(refused.value) == "users_first_engineer"
    assert keeps_engineer(empty, add_user(empty, "A", ENGINEER, (), {"pin": "h"}, NOW)).engineers


def test_the_number_of_users_is_limited() -> None:
    users = UserBook(tuple(User(f"U{number}", OPERATOR, pin="h") for number in range(MOST_USERS)))
    with pytest.raises(UsersError) as refused:
        add_user(users, "A", OPERATOR, (), {"pin": "h"}, NOW)
    assert code_of(refused.value) == "users_full"


def test_a_change_leaves_the_rest_as_it_is() -> None:
    before = book()
    changed = set_role(before, "m. sato", ENGINEER, None, NOW)
    sato = changed.user("M. Sato")
    assert sato is not None
    assert (sato.role, sato.groups, sato.pin, sato.changed) == (ENGINEER, ("quality",), "hash", NOW)
    assert changed.user("J. Brandt") == before.user("J. Brandt")
    assert keeps_engineer(changed, remove_user(changed, "J. Brandt")).engineers == (sato,)
    assert revoke_token(before, "line").tokens == ()


def test_a_version_is_the_last_change_of_its_user() -> None:
    users = (
        book()
        .with_change(NOW, "add", "M. Sato", "", "root")
        .with_change(NOW, "add", "J. Brandt", "", "root")
    )
    assert [users.version(name) for name in ("m. sato", "J. Brandt", "Nobody")] == [1, 2, 0]

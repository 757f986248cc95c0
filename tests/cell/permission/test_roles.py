"""A role includes those below it; a group is its members' and the engineers'."""

import pytest

from app.panel.roles import ROLES, meets
from app.records.principal import Principal, anonymous


@pytest.mark.parametrize("number", range(len(ROLES)))
def test_a_role_includes_those_below_it(number: int) -> None:
    role = ROLES[number]
    assert [needs for needs in ROLES if meets(needs, role)] == list(ROLES[: number + 1])


def test_a_group_is_its_members_and_the_engineers() -> None:
    assert meets("quality", "operator", frozenset({"quality"}))
    assert not meets("quality", "maintenance", frozenset({"tooling"}))
    assert meets("quality", "engineer")


def test_an_unknown_role_meets_nothing_but_no_need() -> None:
    assert meets("", "someone")
    assert not meets("viewer", "someone")


def test_a_principal_without_users_is_an_engineer() -> None:
    assert Principal(anonymous("127.0.0.1")).meets("engineer")
    assert not Principal(anonymous("127.0.0.1"), "anna", "operator").meets("maintenance")

"""The hash that stands for a user who does not exist: as costly to check as a real one."""

import pytest
from cryptography.exceptions import InvalidKey
from cryptography.hazmat.primitives.kdf.argon2 import Argon2id

from app.cell.people.secrets_hash import LARGE, SMALL, Cost, hashed, matches, unmatched_hash


@pytest.mark.parametrize("cost", [LARGE, SMALL])
def test_no_secret_has_the_unmatched_hash_and_checking_it_costs_the_same(cost: Cost) -> None:
    unmatched = unmatched_hash(cost)
    assert unmatched.split("$")[1:4] == hashed("1234", cost).split("$")[1:4]  # the kind and its cost
    with pytest.raises(InvalidKey):  # it was computed; a text that is not a hash is a ValueError
        Argon2id.verify_phc_encoded(b"", unmatched)
    assert not matches(unmatched, "")
    assert unmatched_hash(cost) != unmatched

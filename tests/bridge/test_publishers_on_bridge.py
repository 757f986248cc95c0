"""A publisher that takes a permission back and is gone before the bridge hears it: real DDS."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.faults.publishers import KINDS, Kind, Publishers
from tests.faults.rig import several

TRIALS = several(2, 50)  # of each of two kinds
ONCE = KINDS[0]
AT_ONCE = next(kind for kind in KINDS if not kind.matched and kind.durability == "volatile")
LATCHED = next(kind for kind in KINDS if kind.durability == "transient_local")
CLOSED_BY = several(2, 20)


@pytest.fixture
def publishers(domain: int, tmp_path: Path) -> Iterator[Publishers]:
    mine = Publishers(domain + 3, tmp_path)
    yield mine
    mine.close()


def test_a_false_that_a_new_publisher_says_is_never_passed_over_where_that_one_was_seen(
    publishers: Publishers,
) -> None:
    found = [publishers.trial("fast", kind) for kind in (ONCE, AT_ONCE) for _ in range(TRIALS)]
    assert [one for one in found if one.permitted and (one.seen or one.heard)] == []


def test_a_publisher_that_stays_and_says_nothing_locks_until_one_speaks(publishers: Publishers) -> None:
    publishers.open()
    silent = Kind("silent", times=0, matched=False)
    with publishers.there("fast", silent):
        publishers.until_reason("Locked: a new publisher of /kept has not published yet.")
    publishers.until_reason("Locked: a new publisher of /kept has not published yet.")
    publishers.open()


def test_a_latched_false_always_closes(domain: int, tmp_path: Path) -> None:
    publishers = Publishers(domain + 3, tmp_path, LATCHED.durability)
    try:
        found = [publishers.trial("fast", LATCHED) for _ in range(CLOSED_BY)]
    finally:
        publishers.close()
    assert [one.outcome for one in found] == ["heard"] * CLOSED_BY

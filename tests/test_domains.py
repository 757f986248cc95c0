"""ROS 2 domains of processes that test beside each other: none is used by two."""

import pytest

from tests.support.domains import EACH, FIRSTS, OWN, cyclone, first


def test_no_domain_is_of_two_processes() -> None:
    all_of_them = [begin + n for begin in FIRSTS for n in range(EACH)]
    assert len(set(all_of_them)) == len(all_of_them)
    assert {
        number for number in all_of_them if not (0 < number <= 101 or 215 <= number <= 232)
    } == set()


@pytest.mark.parametrize("more", [-1, OWN, OWN + 1, EACH])
def test_a_domain_of_another_process_is_refused(more: int) -> None:
    with pytest.raises(ValueError, match=f"^domain {int(first()) + more}: "):
        first() + more
    with pytest.raises(ValueError, match=f"^domain {int(first()) + more}: "):
        first() + 1 + (more - 1)


def test_the_domains_of_a_process_are_its_tests_and_the_cyclone_robots() -> None:
    own = [first() + n for n in range(OWN)]
    assert [*own, *cyclone()] == list(range(first(), int(first()) + EACH))

"""A queue that is bounded in number and in bytes, and a dictionary of the newest entries."""

import pytest

from app.system.limits import BoundedDict, BoundedQueue


def test_the_oldest_leave_when_there_are_too_many() -> None:
    queue: BoundedQueue[str] = BoundedQueue(2, 100)
    assert [queue.add(item, 1) for item in "abc"] == [[], [], ["a"]]
    assert (list(queue), len(queue), queue[0]) == (["b", "c"], 2, "b")


def test_the_oldest_leave_when_they_are_too_large_and_the_newest_stays() -> None:
    queue: BoundedQueue[str] = BoundedQueue(9, 10)
    queue.add("a", 4)
    queue.add("b", 4)
    assert queue.add("c", 5) == ["a"]
    assert queue.add("d", 99) == ["b", "c"]
    assert list(queue) == ["d"]


def test_taking_an_item_makes_room() -> None:
    queue: BoundedQueue[str] = BoundedQueue(9, 10)
    queue.add("a", 9)
    assert queue.take() == "a"
    assert queue.add("b", 10) == []
    queue.take()
    with pytest.raises(IndexError):
        queue.take()


def test_a_dictionary_keeps_the_entries_that_were_set_last() -> None:
    kept = BoundedDict[str, int](2)
    kept["a"], kept["b"] = 1, 2
    kept["a"] = 3  # again: "b" is the older one now
    kept["c"] = 4
    assert kept == {"a": 3, "c": 4}

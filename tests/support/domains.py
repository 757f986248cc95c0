"""ROS 2 domains and ports reserved for this process, so that parallel workers and test runs on one
machine do not interfere."""

import atexit
import os
import socket
from collections.abc import Iterator
from functools import cache
from itertools import cycle, islice
from typing import Final

EACH: Final = 11  # per process: those of the tests, then two of the Cyclone DDS robot
OWN: Final = EACH - 2
# ROS 2's domains 0 to 101 work on every system, on Linux 215 to 232 as well.
FIRSTS: Final = (*range(1, 91, EACH), 215)
LOCK: Final = "\0operator-panel-tests-{}"  # an abstract socket name: released with the process


PORTS: Final = 1000  # per process
FIRST_PORT: Final = 20_000


@cache
def _place() -> int:
    """A number that is unique among running processes."""
    for number in range(len(FIRSTS)):
        place = (os.getpid() + number) % len(FIRSTS)
        lock = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        try:
            lock.bind(LOCK.format(place))
        except OSError:
            lock.close()
            continue
        atexit.register(lock.close)
        return place
    raise RuntimeError(f"{len(FIRSTS)} workers of tests run already on this machine")


class Domain(int):
    """A domain of this process. A sum that is none of the tests' domains here is refused: another
    process or the Cyclone DDS robot has it, and each would hear the other's nodes."""

    def __add__(self, more: int) -> "Domain":
        begin, number = FIRSTS[_place()], int(self) + more
        if not begin <= number < begin + OWN:
            raise ValueError(f"domain {number}: the tests of this process have {OWN} from {begin} on")
        return Domain(number)


def first() -> Domain:
    """The first of `OWN` domains of this process."""
    return Domain(FIRSTS[_place()])


@cache
def _ports() -> Iterator[int]:
    begin = FIRST_PORT + PORTS * _place()
    return cycle(range(begin, begin + PORTS))


def ports() -> Iterator[int]:
    """Each port of this process once, the least recently used first."""
    return islice(_ports(), PORTS)


def cyclone() -> tuple[int, int]:
    """The domains of the Cyclone DDS robot."""
    begin = FIRSTS[_place()] + OWN
    return begin, begin + 1

"""ROS 2's domains and ports of this process alone: workers, and runs of the tests on one machine, hear
nothing of each other."""

import atexit
import os
import socket
from collections.abc import Iterator
from functools import cache
from itertools import cycle, islice
from typing import Final

EACH: Final = 11  # of one process
# ROS 2's domains 0 to 101 work on every system, on Linux 215 to 232 as well.
FIRSTS: Final = (*range(1, 91, EACH), 215)
LOCK: Final = "\0operator-panel-tests-{}"  # a name in the kernel: it goes with the process


PORTS: Final = 1000  # of one process
FIRST_PORT: Final = 20_000


@cache
def _place() -> int:
    """A number that no other process has until this one ends."""
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


def first() -> int:
    """The first of `EACH` domains of this process."""
    return int(FIRSTS[_place()])


@cache
def _ports() -> Iterator[int]:
    begin = FIRST_PORT + PORTS * _place()
    return cycle(range(begin, begin + PORTS))


def ports() -> Iterator[int]:
    """Each port of this process once, those first that were not given for long."""
    return islice(_ports(), PORTS)


def cyclone() -> tuple[int, int]:
    """Those of the Cyclone DDS robot."""
    return first() + 9, first() + 10

"""ROS 2's domains of this run alone: runs of the tests on one machine hear nothing of each other."""

import atexit
import os
import socket
from typing import Final

EACH: Final = 11  # of one run; ROS 2's domains 0 to 101 work on every system
RUNS: Final = 8
LOCK: Final = "\0operator-panel-tests-{}"  # a name in the kernel: it goes with the process


def reserved() -> int:
    """The first of `EACH` domains that no other run has, until this process ends."""
    for number in range(RUNS):
        place = (os.getpid() + number) % RUNS
        lock = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        try:
            lock.bind(LOCK.format(place))
        except OSError:
            lock.close()
            continue
        atexit.register(lock.close)
        return 1 + place * EACH
    raise RuntimeError(f"{RUNS} runs of the tests go on already on this machine")


FIRST: Final = reserved()
CYCLONE: Final = FIRST + 9, FIRST + 10

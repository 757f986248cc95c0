"""A command whose output is closed before its end, as by `| head`."""

import os
import signal
import sys
from collections.abc import Callable
from typing import Final

CLOSED: Final = 128 + signal.SIGPIPE  # as a shell reports a program that ended by it


def until_closed(work: Callable[[], int]) -> int:
    """Its exit status; `CLOSED`, without a message, once what it writes can go nowhere."""
    try:
        try:
            return work()
        finally:
            sys.stdout.flush()
            sys.stderr.flush()
    except BrokenPipeError:
        nowhere = os.open(os.devnull, os.O_WRONLY)  # for the flush at exit
        os.dup2(nowhere, sys.stdout.fileno())
        os.dup2(nowhere, sys.stderr.fileno())
        return CLOSED

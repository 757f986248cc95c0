"""Functions that tests run in a child process (`app.system.worker`)."""

import os
import signal
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from app.system.errors import LogError
from app.system.texts import say


def echo(*values: Any) -> Iterator[Any]:
    print("this is no result")
    yield from values


def end(how: str) -> Iterator[Any]:
    """After one result it ends in this way."""
    yield how
    if how == "a sentence":
        raise LogError(say("disk_full"))
    if how == "an exception":
        raise ZeroDivisionError("by nothing")
    if how == "a status":
        sys.exit(3)
    if how == "a signal":
        os.kill(os.getpid(), signal.SIGTERM)
    if how == "memory":
        yield "x" * 1_000_000_000
    while how == "time":
        pass
    if how == "a strange value":
        yield Path("/")


def talk(count: int) -> Iterator[Any]:
    """Writes so many bytes to stderr."""
    os.write(2, b"w" * count)
    yield "done"


def own_pid(file: Path) -> Iterator[Any]:
    """Writes the child's id, then waits for its end."""
    file.write_text(str(os.getpid()))
    yield "begun"
    time.sleep(600)

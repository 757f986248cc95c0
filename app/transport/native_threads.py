"""Zenoh's threads, which Python did not start: without `attach`, Python makes a thread state at each
call from one, and drops it after the call."""

import ctypes
import os
import threading
from typing import Final

# Zenoh's own setting of its threads, read when its first session opens. By default the thread that
# waits for the network wakes another one for each message: where one does both, it costs half.
RUNTIME: Final = "(rx: (handover: net))"
os.environ.setdefault("ZENOH_RUNTIME", RUNTIME)
_KNOWN: Final[set[int]] = set()


def attach() -> None:
    """Called at every call from such a thread; does its work at the first one."""
    me = threading.get_ident()
    if me not in _KNOWN:
        _KNOWN.add(me)
        if all(thread.ident != me for thread in threading.enumerate()):  # those have theirs
            ctypes.pythonapi.PyGILState_Ensure()

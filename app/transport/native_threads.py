"""Threads that Python did not start, as those of Zenoh: without `attach`, Python makes a thread state
at each call from one, and drops it after the call."""

import ctypes
import threading
from typing import Final

_KNOWN: Final[set[int]] = set()


def attach() -> None:
    """Called at every call from such a thread; does its work at the first one."""
    me = threading.get_ident()
    if me not in _KNOWN:
        _KNOWN.add(me)
        if all(thread.ident != me for thread in threading.enumerate()):  # those have theirs
            ctypes.pythonapi.PyGILState_Ensure()

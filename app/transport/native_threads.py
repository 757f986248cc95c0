"""Keeps the Python thread state of Zenoh's threads, which Python did not start. Without `attach`,
Python creates one at each callback and deletes it afterwards."""

import ctypes
import os
import threading
from typing import Final

# Zenoh's own setting of its threads, read when its first session opens. By default the thread that
# waits for the network wakes another one for each message; one thread for both costs half.
RUNTIME: Final = "(rx: (handover: net))"
os.environ.setdefault("ZENOH_RUNTIME", RUNTIME)
_KNOWN: Final[set[int]] = set()


def attach() -> None:
    """Call it in every callback on such a thread. Only the first call in a thread has an effect."""
    me = threading.get_ident()
    if me not in _KNOWN:
        _KNOWN.add(me)
        if all(thread.ident != me for thread in threading.enumerate()):  # those have theirs
            ctypes.pythonapi.PyGILState_Ensure()

"""Threads that Python did not start, and that call into it often.

For each such call CPython makes the thread a state of its own, with memory from the system, and takes
both down again after it: ten times what the call itself costs. A thread that attaches once more than
it detaches keeps its state (`PyGILState_Ensure` may be nested; source: CPython's C API).
"""

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

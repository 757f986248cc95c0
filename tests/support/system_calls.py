"""A filter of system calls, as a unit has it: seccomp(2). Needs root, or no new privileges."""

import ctypes
import errno
import platform
import struct
from typing import Final

# Those of SystemCallFilter=~@resources that Python's library calls.
NUMBERS: Final = {
    "x86_64": {"setpriority": 141, "setrlimit": 160, "sched_setaffinity": 203},
    "aarch64": {"setpriority": 140, "setrlimit": 164, "sched_setaffinity": 122},
}
PR_SET_NO_NEW_PRIVS, PR_SET_SECCOMP, SECCOMP_MODE_FILTER = 38, 22, 2
LOAD, EQUAL, RETURN = 0x20, 0x15, 0x06  # of BPF
ALLOW, ERRNO = 0x7FFF0000, 0x00050000


def forbid_resources() -> None:
    """From now on these calls of the process fail with EPERM."""
    numbers = NUMBERS[platform.machine()].values()
    program = struct.pack("HBBI", LOAD, 0, 0, 0)
    for left, number in zip(range(len(numbers), 0, -1), numbers, strict=True):
        program += struct.pack("HBBI", EQUAL, left, 0, number)
    program += struct.pack("HBBI", RETURN, 0, 0, ALLOW)
    program += struct.pack("HBBI", RETURN, 0, 0, ERRNO | errno.EPERM)
    code = ctypes.create_string_buffer(program)
    filter_program = ctypes.create_string_buffer(
        struct.pack("HxxxxxxQ", len(program) // 8, ctypes.addressof(code))
    )
    library = ctypes.CDLL(None, use_errno=True)
    library.prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0)
    if library.prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, filter_program, 0, 0):
        raise OSError(ctypes.get_errno(), "seccomp")

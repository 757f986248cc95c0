"""Runs a command with the restrictions of a unit, as far as that needs no systemd: `python -m
tests.support.sandbox UNIT COMMAND…`, as root, in a mount namespace of its own.

By libseccomp and prctl: the unit's system calls (by the lists of `systemd-analyze syscall-filter`),
RestrictAddressFamilies, RestrictNamespaces, RestrictRealtime, MemoryDenyWriteExecute, NoNewPrivileges.
By mounts: ProtectSystem=strict, with the data folder and that of temporary files writable. By setpriv:
no capabilities. Not here: the user of its own, ProtectHome, ProtectProc, PrivateDevices, PrivateUsers,
RestrictSUIDSGID.
"""

import ctypes
import errno
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Final

PR_SET_NO_NEW_PRIVS, PR_SET_MDWE, MDWE_REFUSE_EXEC_GAIN = 38, 65, 1
ALLOW, REFUSE, NOT_THERE = 0x7FFF0000, 0x00050000 | errno.EPERM, 0x00050000 | errno.ENOSYS
EQUAL, MASKED = 4, 7  # of libseccomp: SCMP_CMP_EQ, SCMP_CMP_MASKED_EQ
NAMESPACES: Final = 0x7E020080  # every CLONE_NEW… flag
FAMILIES: Final = {"AF_UNIX": 1, "AF_INET": 2, "AF_INET6": 10, "AF_NETLINK": 16}


class Compared(ctypes.Structure):
    """struct scmp_arg_cmp."""

    _fields_ = (
        ("arg", ctypes.c_uint),
        ("op", ctypes.c_int),
        ("a", ctypes.c_uint64),
        ("b", ctypes.c_uint64),
    )


def setting(unit: str, name: str) -> list[str]:
    """The values of a key of a unit, one for each line."""
    return re.findall(rf"^{name}=(.*)$", unit, re.MULTILINE)


@cache
def _sets() -> dict[str, list[str]]:
    """The lists of system calls by their names."""
    text = subprocess.run(
        ["systemd-analyze", "syscall-filter", "--no-pager"], check=True, capture_output=True, text=True
    ).stdout
    sets: dict[str, list[str]] = {}
    members: list[str] = []
    for line in re.sub(r"\x1b\[[0-9;]*m", "", text).splitlines():
        if line.startswith("@"):
            sets[line.split()[0]] = members = []
        elif line.startswith("    ") and not line.strip().startswith("#"):
            members.append(line.strip())
    return sets


def _expanded(name: str) -> Iterator[str]:
    if not name.startswith("@"):
        yield name
        return
    for member in _sets()[name]:
        yield from _expanded(member)


def allowed_calls(unit: str) -> set[str]:
    """The names of the system calls that the unit allows."""
    calls: set[str] = set(_expanded("@default"))
    for value in setting(unit, "SystemCallFilter"):
        names = {call for part in value.removeprefix("~").split() for call in _expanded(part)}
        calls = calls - names if value.startswith("~") else calls | names
    return calls


def restrict(unit: str) -> None:
    """Restricts this process, and those that it starts."""
    library = ctypes.CDLL("libseccomp.so.2", use_errno=True)
    library.seccomp_init.restype = ctypes.c_void_p
    context = ctypes.c_void_p(library.seccomp_init(ctypes.c_uint32(REFUSE)))

    def allow(call: str, *conditions: Compared) -> None:
        number = library.seccomp_syscall_resolve_name(call.encode())
        if number < 0:
            return  # of another architecture
        array = (Compared * len(conditions))(*conditions)
        if library.seccomp_rule_add_array(context, ALLOW, number, len(conditions), array):
            raise OSError(f"{call} can't be allowed")

    calls = allowed_calls(unit)
    for call in sorted(calls - {"socket", "clone", "clone3", "unshare", "setns", "sched_setscheduler"}):
        allow(call)
    for family in setting(unit, "RestrictAddressFamilies")[0].split():
        allow("socket", Compared(0, EQUAL, FAMILIES[family], 0))
    allow("clone", Compared(0, MASKED, NAMESPACES, 0))
    # The flags of clone3 are in memory, where no filter sees them: without it, libc takes clone.
    clone3 = library.seccomp_syscall_resolve_name(b"clone3")
    library.seccomp_rule_add_array(context, NOT_THERE, clone3, 0, None)
    if library.seccomp_load(context):
        raise OSError("the filter can't be loaded")
    library.seccomp_release(context)


def mount_commands(data: Path, *writable: Path) -> str:
    """Shell commands that make all but these folders and /tmp read-only, for a mount namespace."""
    binds = [f"mount --bind {path} {path}" for path in (data, *writable)]
    return " && ".join(
        [
            *binds,
            "mount -o remount,bind,ro /",
            "mount -t tmpfs tmpfs /dev/shm",
        ]
    )


def main() -> None:
    unit = Path(sys.argv[1]).read_text()
    libc = ctypes.CDLL(None, use_errno=True)
    libc.prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0)
    # Since Linux 6.3; systemd does the same by its filter on older ones.
    if libc.prctl(PR_SET_MDWE, MDWE_REFUSE_EXEC_GAIN, 0, 0, 0):
        raise OSError(ctypes.get_errno(), "MemoryDenyWriteExecute")
    restrict(unit)
    os.execvp(sys.argv[2], sys.argv[2:])


if __name__ == "__main__":
    main()

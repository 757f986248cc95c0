"""Whether the clock of this machine follows a time source, as the kernel and the service manager say.
It reads, and sets nothing.

Source: adjtimex(2), struct timex of <sys/timex.h>; systemd's timedated counts a clock as synchronised
by the same limit.
"""

import ctypes
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

RUN: Final = Path("/run")
# What each program has there while it runs, and its name.
PROGRAMS: Final = (("systemd/timesync", "systemd-timesyncd"), ("chrony", "chrony"))
TIMESYNC: Final = "systemd/timesync"
SYNCHRONISED: Final = "synchronized"  # beside it, since the first answer of a server
UNSYNCHRONISED_US: Final = 16_000_000  # the kernel's maximum error of a clock that nothing corrects
ANSWERS_WITHIN_S: Final = 3.0


@dataclass(frozen=True, slots=True)
class TimeSource:
    """`synchronised` is None where nothing says so. `source` is the program that sets the clock, "" if
    that is not known. `within_s` is how far the clock is from the source at most, in seconds."""

    synchronised: bool | None = None
    source: str = ""
    within_s: float | None = None


class _Timex(ctypes.Structure):
    _fields_ = (
        ("modes", ctypes.c_uint),
        ("offset", ctypes.c_long),
        ("freq", ctypes.c_long),
        ("maxerror", ctypes.c_long),
        ("rest", ctypes.c_byte * 256),
    )


def kernel_error_us() -> int | None:
    """The maximum error of the clock in microseconds; None where the kernel does not tell it, as in the
    unit of the server, which may not touch the clock."""
    timex = _Timex()
    try:
        libc = ctypes.CDLL(None)
        state = libc.adjtimex(ctypes.byref(timex))
    except (OSError, AttributeError):
        return None
    return int(timex.maxerror) if state >= 0 else None


def timedatectl_says() -> str:
    """ "yes", "no", or "" where systemd is not running or does not answer."""
    program = shutil.which("timedatectl")
    if program is None:
        return ""
    command = [program, "show", "--property=NTPSynchronized", "--value"]
    try:
        ran = subprocess.run(command, capture_output=True, text=True, timeout=ANSWERS_WITHIN_S)
    except (OSError, subprocess.TimeoutExpired):
        return ""
    return ran.stdout.strip() if ran.returncode == 0 else ""


def read_time_source(
    run: Path = RUN,
    error_us: Callable[[], int | None] = kernel_error_us,
    ask: Callable[[], str] = timedatectl_says,
) -> TimeSource:
    """Blocks for three seconds at most: the kernel first, then the file of systemd-timesyncd, then
    `timedatectl`."""
    source = next((name for folder, name in PROGRAMS if (run / folder).exists()), "")
    error = error_us()
    if error is not None:
        if error >= UNSYNCHRONISED_US:
            return TimeSource(False, source)
        return TimeSource(True, source, error / 1e6)
    if (run / TIMESYNC / SYNCHRONISED).exists():
        return TimeSource(True, source)
    said = {"yes": True, "no": False}.get(ask())
    return TimeSource(said, source if said is not None else "")

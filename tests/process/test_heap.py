"""What was used once does not stay resident."""

import ctypes
from pathlib import Path
from types import SimpleNamespace

import pytest

from app.process import heap

MIB = 1024 * 1024


def resident() -> int:
    """Bytes of this process that are in memory."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * 4096


def test_what_was_freed_below_what_is_used_goes_back() -> None:
    used = [bytes(1000) for _ in range(32 * MIB // 1000)]
    last = used[-1]  # keeps the C library from giving back what is below
    del used
    before = resident()
    heap.trim()
    assert before - resident() > 24 * MIB
    assert len(last) == 1000


def test_another_c_library_is_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ctypes, "CDLL", lambda _: SimpleNamespace())
    heap.trim()

"""A thread that Python did not start keeps its state from one call into Python to the next."""

import subprocess
import sys
import threading
from types import SimpleNamespace

import pytest
import zenoh
from zenoh.handlers import Callback

from app.ros.zenoh import answers
from app.ros.zenoh.answers import attach
from app.ros.zenoh.config import config_to
from tests.support.parts import ROOT, until

LEAVING = """
import sys
from app.ros.dialects.bridge_dialect import BridgeDialect
from app.ros.zenoh.declarations import Declarations
from app.ros.zenoh.config import config_to
from app.ros.zenoh.session import ZenohSession
link = ZenohSession(config_to(sys.argv[1]), lambda _: None, BridgeDialect())
link.start(Declarations(subscribe={"a": "a"}))
while not link.drain().samples:
    pass
"""


def test_attached_thread_keeps_its_state(peer: tuple[str, zenoh.Session]) -> None:
    endpoint, there = peer
    own = threading.local()
    kept: dict[int, list[bool]] = {}

    def hear(_: zenoh.Sample) -> None:
        attach()
        kept.setdefault(threading.get_native_id(), []).append(hasattr(own, "mark"))
        own.mark = True

    with zenoh.open(config_to(endpoint)) as here:
        here.declare_subscriber("a", Callback(hear, indirect=False))
        until(lambda: (there.put("a", b""), sum(map(len, kept.values())) > 20)[1], "it is heard")
    assert threading.get_native_id() not in kept
    for marks in kept.values():
        assert marks == [False, *[True] * (len(marks) - 1)]


def test_a_thread_of_pythons_own_is_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """It ends with its state, and would leave it behind."""
    calls: list[int] = []
    api = SimpleNamespace(PyGILState_Ensure=lambda: calls.append(threading.get_native_id()))
    monkeypatch.setattr(answers, "ctypes", SimpleNamespace(pythonapi=api))
    monkeypatch.setattr(answers, "_attached", threading.local())
    thread = threading.Thread(target=attach)
    thread.start()
    thread.join(5)
    attach()
    assert calls == []


def test_a_process_ends_though_samples_still_come(peer: tuple[str, zenoh.Session]) -> None:
    endpoint, there = peer
    over = threading.Event()

    def flood() -> None:
        while not over.wait(0.0005):
            there.put("a", b"x")

    shouting = threading.Thread(target=flood, daemon=True)
    shouting.start()
    try:
        command = [sys.executable, "-c", LEAVING, endpoint]
        for _ in range(3):
            ended = subprocess.run(command, cwd=ROOT, capture_output=True, timeout=60, check=False)
            assert (ended.returncode, ended.stderr) == (0, b"")
    finally:
        over.set()
        shouting.join(5)

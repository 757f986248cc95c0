"""`/readyz` asks the bridge itself; `/healthz` needs no one."""

import ctypes
import os
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path

import httpx
import pytest
import zenoh

from tests.support.parts import ROOT, Bridge, Process, Server, free_port, live, until
from tests.web.test_server import client_of

# Of ptrace(2) and waitpid(2).
PTRACE_SEIZE, PTRACE_INTERRUPT, PTRACE_DETACH, WALL = 0x4206, 0x4207, 17, 0x40000000

BUSY = """
import asyncio, sys, threading
import anyio.to_thread, uvicorn
from app.main import app

async def main():
    never = threading.Event()
    server = uvicorn.Server(uvicorn.Config(app, port=int(sys.argv[1])))
    for _ in range(100):
        asyncio.get_running_loop().run_in_executor(None, never.wait)
    waiting = [asyncio.ensure_future(anyio.to_thread.run_sync(never.wait)) for _ in range(100)]
    print("busy", file=sys.stderr)
    await server.serve()

asyncio.run(main())
"""


@contextmanager
def main_loop_hangs(bridge: Bridge) -> Iterator[None]:
    """Stops the threads that run the bridge's own code; Zenoh's go on, so its token stays."""
    libc = ctypes.CDLL(None, use_errno=True)
    ptrace = libc.ptrace
    ptrace.argtypes = [ctypes.c_long, ctypes.c_long, ctypes.c_void_p, ctypes.c_void_p]
    tasks = Path(f"/proc/{bridge.process.pid}/task")
    workers = [int(task.name) for task in tasks.iterdir() if "tokio" in (task / "comm").read_text()]
    assert workers
    held = []
    try:
        for thread in workers:
            assert ptrace(PTRACE_SEIZE, thread, None, None) == 0, ctypes.get_errno()
            held.append(thread)
            assert ptrace(PTRACE_INTERRUPT, thread, None, None) == 0
            os.waitpid(thread, WALL)
        yield
    finally:
        for thread in held:
            ptrace(PTRACE_DETACH, thread, None, None)


def some_time_passes(kiosk: Server) -> None:
    """More than a second: an earlier answer is too old to be given."""
    with kiosk.stream() as stream:
        for _ in range(4):
            stream.next("beat")


@pytest.mark.long("real time")
def test_a_bridge_whose_main_loop_hangs_is_seen_at_the_request(
    own_bridge: Bridge, tmp_path: Path, servers: Callable[[Server], Server]
) -> None:
    kiosk = servers(live(own_bridge.endpoint, tmp_path, EXACT_LIVENESS="1"))
    until(kiosk.ready, "ready")
    some_time_passes(kiosk)
    with main_loop_hangs(own_bridge):
        began = time.monotonic()
        with ThreadPoolExecutor(20) as pool:
            answers = list(pool.map(lambda _: kiosk.http.get("/readyz"), range(20)))
        assert time.monotonic() - began < 3
        for answer in answers:
            assert (answer.status_code, answer.json()["code"]) == (503, "link_bridge_silent")
        assert "does not respond" in answers[0].json()["reason"]
        assert kiosk.http.get("/healthz").status_code == 200
        until(lambda: not kiosk.widget("operation")["enabled"], "and soon all is locked", within_s=8)
    until(kiosk.ready, "ready again")


def test_a_bridge_whose_main_loop_ended_is_seen_at_the_request(
    own_bridge: Bridge, tmp_path: Path, servers: Callable[[Server], Server]
) -> None:
    kiosk = servers(live(own_bridge.endpoint, tmp_path, EXACT_LIVENESS="1"))
    until(kiosk.ready, "ready")
    with zenoh.open(client_of(own_bridge)) as other:
        token = other.liveliness().declare_token(f"@/{other.zid()}/@ros2_lv/XY")
        until(lambda: "panicked" in own_bridge.process.text, "the bridge's main loop ended")
        some_time_passes(kiosk)
        answer = kiosk.http.get("/readyz")
        token.undeclare()
    assert own_bridge.process.running
    assert answer.status_code == 503
    assert answer.json()["code"] in ("link_no_bridge", "link_bridge_silent")


def test_health_answers_while_every_thread_of_the_executors_is_busy(tmp_path: Path) -> None:
    port = free_port()
    variables = {"PYTHONPATH": str(ROOT), "KIOSK_DATA": str(tmp_path)}
    process = Process([sys.executable, "-c", BUSY, str(port)], variables, cwd=ROOT)
    with httpx.Client(base_url=f"http://127.0.0.1:{port}", timeout=2, trust_env=False) as http:

        def says(path: str) -> bool:
            with suppress(httpx.TransportError):
                return http.get(path).status_code == 200
            return False

        try:
            until(lambda: says("/healthz"), "healthz answers")
            until(lambda: says("/readyz"), "readyz too")
            assert process.count("busy")
        finally:
            process.kill()

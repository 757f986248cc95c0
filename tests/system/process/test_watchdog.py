"""What the service manager is sent, on a real socket of its protocol, by the real server."""

import asyncio
import os
import signal
import socket
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from itertools import pairwise
from pathlib import Path

import httpx
import pytest

from app.system.process.service import ServiceManager, Watchdog, status_line
from tests.support.parts import ROOT, Process, Server, free_port, http_client, live, until

INTERVAL_S = 1.0
WATCHED = {"WATCHDOG_USEC": str(int(INTERVAL_S * 1e6))}

# A Zenoh callback that never returns, and holds the inbox's lock: what the watchdog is for. Not at an
# immediate wake: before it the inbox may be drained, at which the event loop would stall, too.
STANDS_STILL = """
import signal, sys, threading, time, uvicorn
from app.main import app

def link_stands_still(*_):
    inbox = app.state.app_state.fleet.first.link._inbox
    wake = inbox._wake_loop
    inbox._wake_loop = lambda immediate: wake(True) if immediate else threading.Event().wait()

def loop_stands_still(*_):
    time.sleep(60)

signal.signal(signal.SIGUSR1, link_stands_still)
signal.signal(signal.SIGUSR2, loop_stands_still)
uvicorn.run(app, port=int(sys.argv[1]))
"""


class Listener:
    """The service manager's end of the socket."""

    def __init__(self, address: str) -> None:
        self.address = address
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.bind("\0" + address[1:] if address.startswith("@") else address)

    def next(self, timeout_s: float = 10.0) -> dict[str, str]:
        """The next message by its names; TimeoutError when none comes."""
        self._socket.settimeout(timeout_s)
        text = self._socket.recv(4096).decode()
        return dict(line.split("=", 1) for line in text.split("\n"))

    def until(self, name: str) -> dict[str, str]:
        """The next message with this name."""
        end = time.monotonic() + 20
        while time.monotonic() < end:
            if name in (message := self.next()):
                return message
        raise AssertionError(f"no {name}")

    def silent_for(self, name: str, seconds: float) -> bool:
        """Whether this name does not come for so long."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            with suppress(TimeoutError):
                if name in self.next(left):
                    return False
        return True

    def close(self) -> None:
        self._socket.close()


def ready(listener: Listener) -> bool:
    return listener.next(20).get("STATUS", "").startswith("Ready")


@pytest.fixture(params=["path", "abstract"])
def address(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    return f"@kiosk-test-{os.getpid()}" if request.param == "abstract" else str(tmp_path / "notify")


@pytest.fixture
def listener(tmp_path: Path) -> Iterator[Listener]:
    mine = Listener(str(tmp_path / "notify"))
    yield mine
    mine.close()


@pytest.mark.long("real time")
def test_watchdog_reports_ready_status_and_stopping(address: str) -> None:
    manager = Listener(address)
    port = free_port()
    command = [sys.executable, "-m", "uvicorn", "app.main:app", "--port", str(port)]
    process = Process(command, {"NOTIFY_SOCKET": address, **WATCHED, "PYTHONPATH": ""}, cwd=ROOT)
    try:
        assert manager.next(20) == {"READY": "1"}
        answer = httpx.get(f"http://127.0.0.1:{port}/healthz", trust_env=False)
        assert answer.status_code == 200  # the first request, at once
        times = []
        for _ in range(3):
            message = manager.until("WATCHDOG")
            times.append(time.monotonic())
            assert "STATUS" in message
        assert max(later - earlier for earlier, later in pairwise(times)) < INTERVAL_S
        until(lambda: ready(manager), "the state in words")
        process.send(signal.SIGTERM)
        assert manager.until("STOPPING")["STATUS"] == "Shutting down."
    finally:
        process.end()
        manager.close()


@pytest.fixture
def wounded(listener: Listener) -> Iterator[tuple[Process, httpx.Client]]:
    """A server that a signal makes stand still."""
    port = free_port()
    env = {"NOTIFY_SOCKET": listener.address, **WATCHED, "PYTHONPATH": str(ROOT)}
    process = Process([sys.executable, "-c", STANDS_STILL, str(port)], env, cwd=ROOT)
    try:
        with http_client(f"http://127.0.0.1:{port}") as http:
            until(lambda: ready(listener), "it is well")
            yield process, http
    finally:
        process.kill()


def test_no_ping_while_a_callback_holds_the_links_lock(
    listener: Listener, wounded: tuple[Process, httpx.Client]
) -> None:
    process, http = wounded
    with http.stream("GET", "/events"):  # what nobody looks at wakes nobody
        process.send(signal.SIGUSR1)
        until(lambda: "does not respond" in listener.next()["STATUS"], "it is reported")
        assert listener.silent_for("WATCHDOG", 2 * INTERVAL_S)
        assert http.get("/healthz").status_code == 200
    assert process.count("[FATAL]") == 1
    assert process.count("The Zenoh session of Robot does not respond")


def test_no_ping_while_the_event_loop_stands_still(
    listener: Listener, wounded: tuple[Process, httpx.Client]
) -> None:
    process, _ = wounded
    process.send(signal.SIGUSR2)
    until(lambda: listener.silent_for("WATCHDOG", 0.1), "those that were sent before are read")
    assert listener.silent_for("WATCHDOG", 2 * INTERVAL_S)


def test_a_robot_that_is_away_is_no_failure_of_the_server(
    listener: Listener, tmp_path: Path, servers: Callable[[Server], Server]
) -> None:
    nowhere = f"tcp/127.0.0.1:{free_port()}"
    servers(live(nowhere, tmp_path, NOTIFY_SOCKET=listener.address, WATCHDOG_USEC="600000"))
    for _ in range(5):
        status = listener.until("WATCHDOG")["STATUS"]
        assert "No connection to the robot" in status or "connects to the robot" in status


def test_without_a_watchdog_nothing_is_pinged(
    listener: Listener, servers: Callable[[Server], Server]
) -> None:
    servers(Server(ROOT, NOTIFY_SOCKET=listener.address))
    assert listener.next() == {"READY": "1"}
    assert set(listener.next()) == {"STATUS"}


# The protocol's corners.


@pytest.mark.parametrize(
    ("env", "interval_s"),
    [
        ({"WATCHDOG_USEC": "3000000"}, 3.0),
        ({"WATCHDOG_USEC": "3000000", "WATCHDOG_PID": str(os.getpid())}, 3.0),
        ({"WATCHDOG_USEC": "3000000", "WATCHDOG_PID": "1"}, None),
        ({"WATCHDOG_USEC": "soon"}, None),
        ({"WATCHDOG_USEC": "0"}, None),
        ({}, None),
    ],
)
def test_the_interval_is_this_processs_own(env: dict[str, str], interval_s: float | None) -> None:
    assert ServiceManager({"NOTIFY_SOCKET": "/run/x", **env}).interval_s == interval_s
    assert ServiceManager(env).interval_s is None


def test_a_manager_that_does_not_listen_is_logged_once(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    manager = ServiceManager({"NOTIFY_SOCKET": str(tmp_path / "no-listener")})
    manager.notify("READY=1")
    manager.notify("WATCHDOG=1")
    assert len(caplog.records) == 1
    assert not ServiceManager({"NOTIFY_SOCKET": "vsock:2:1"}).is_enabled
    assert not ServiceManager({}).is_enabled


def test_a_state_is_one_line() -> None:
    assert status_line("r1: ready\nr2:  lost") == "STATUS=r1: ready r2: lost"
    assert len(status_line("x" * 10_000)) < 4096


def test_watchdog_does_not_run_without_a_service_manager() -> None:
    asyncio.run(asyncio.wait_for(Watchdog(ServiceManager({}), lambda: (), lambda: "").run(), 1))

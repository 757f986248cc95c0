"""The real parts of tests: bridge, ROS 2 nodes, servers. Each is a process on loopback, and is
ended by the test or fixture that started it."""

import json
import os
import resource
import secrets
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from copy import copy
from pathlib import Path
from typing import Any, ClassVar, Self

import httpx
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from tests.support import domains, places
from tests.support.processes.commanded import Commanded
from tests.support.processes.forked import Forked, can_fork
from tests.support.processes.signals import send_signal

# Without scripts, a press within 700 ms of its page counts as a second tap. Longer, for busy machines.
TAP_AGAIN_MS = 1000
ROOT, TESTS = places.ROOT, places.TESTS
SHIPPED, REFERENCE = places.SHIPPED, places.REFERENCE
BRIDGE, RMW_ROBOT, ROS_PYTHON = places.BRIDGE, places.RMW_ROBOT, places.ROS_PYTHON
CHROMIUM, HEADLESS = places.CHROMIUM, places.HEADLESS
CHROMIUM_FLAGS = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]

# Bridge and nodes discover each other on loopback only.
CYCLONE_ON_LOOPBACK = (
    "<CycloneDDS><Domain><General><Interfaces>"
    '<NetworkInterface name="lo"/>'
    "</Interfaces></General></Domain></CycloneDDS>"
)


MOST_MEMORY = 2 << 30  # bytes of a node

STOOD = "Timeout (0:00:20)!"  # written by a server that hung at shutdown
CALLBACK_FAILED = "a callback on a thread of Zenoh failed"  # what it receives may be lost


# Even on a busy machine, an immediate effect happens within this time.
ENOUGH_S = 40.0
ARRIVES_WITHIN_S = 2.0
SOONEST_S, LATEST_S = 0.015, 0.15  # until the next check of a condition
GROWS = 0.1  # per second of waiting


def until(
    condition: Callable[[], Any], why: str, within_s: float = ENOUGH_S, every_s: float | None = None
) -> Any:
    """Waits for a condition and returns its value; fails with `why` at the timeout. Without `every_s`
    the interval between checks grows with the waiting time: a check may be a request, which takes CPU
    time from the process that it waits for."""
    began = time.monotonic()
    while True:
        if result := condition():
            return result
        waited = time.monotonic() - began
        if waited > within_s:
            raise AssertionError(f"not within {within_s} s: {why}")
        time.sleep(min(SOONEST_S + GROWS * waited, LATEST_S) if every_s is None else every_s)


def free_port() -> int:
    """A free port that is reserved for this process, below the system's ephemeral ports."""
    for port in domains.ports():
        with socket.socket() as probe, suppress(OSError):
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(("127.0.0.1", port))
            return port
    raise RuntimeError("no port is free")


class Process:
    """A child process whose stderr is kept as lines."""

    latest: ClassVar[deque["Process"]] = deque(maxlen=6)  # shown by a failed test

    def __init__(self, command: Sequence[str], env: Mapping[str, str], **options: Any) -> None:
        self._process: subprocess.Popen[str] | Forked
        if can_fork(command, env, options.get("cwd")):
            self._process = Forked.server(command, env)
        else:
            self._process = subprocess.Popen(
                command, env={**os.environ, **env}, stderr=subprocess.PIPE, text=True, **options
            )
        self.lines: list[str] = []
        self.began = time.monotonic()
        self.latest.append(self)
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self._process.stderr is not None
        for line in self._process.stderr:
            self.lines.append(line.rstrip("\n"))

    @property
    def text(self) -> str:
        return "\n".join(self.lines)

    def count(self, words: str) -> int:
        """How often it wrote the words. Waits for the first: log lines arrive later than responses."""
        until(lambda: words in self.text, f"it writes {words!r}")
        return self.text.count(words)

    @property
    def pid(self) -> int:
        return self._process.pid

    @property
    def running(self) -> bool:
        return self._process.poll() is None

    def describe(self, lines: int = 40) -> str:
        """Pid, state, command and the last lines."""
        state = "runs" if self.running else f"ended with {self._process.returncode}"
        return "\n".join([f"{self.pid}, {state}: {self._process.args!r}", *self.lines[-lines:]])

    def send(self, number: signal.Signals) -> None:
        if self.running:
            with suppress(ProcessLookupError):  # it has just ended
                send_signal(self.pid, number)

    def wait(self, timeout_s: float) -> int:
        return self._process.wait(timeout_s)

    def kill(self) -> None:
        self.end(signal.SIGKILL)

    def end(self, number: signal.Signals = signal.SIGTERM, timeout_s: float = 25) -> int:
        """Ends the process and waits; kills it after `timeout_s`."""
        if self.running:
            self.send(number)
        try:
            status = self._process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
            raise AssertionError(f"{self._process.args!r} did not end:\n{self.text}") from None
        self._reader.join(5)
        for pipe in (self._process.stdin, self._process.stdout, self._process.stderr):
            if pipe is not None:
                pipe.close()
        assert STOOD not in self.text, self.text
        assert CALLBACK_FAILED not in self.text, self.text
        return status


class Bridge:
    """The real bridge with the shipped configuration, on a port and a domain of this test."""

    def __init__(self, domain: int, namespace: str = "/", options: Sequence[str] = ()) -> None:
        """`options` are further settings of its configuration, as `path=json5`."""
        self.domain = domain
        self.port = free_port()
        self.endpoint = f"tcp/127.0.0.1:{self.port}"
        self._options = [
            f"plugins/ros2dds/domain={domain}",
            f'plugins/ros2dds/namespace="{namespace}"',
            *options,
        ]
        self._file: Path | None = None
        self._process: Process | None = None

    def configure(self, file: Path) -> None:
        """Sets another configuration for the next start; it has the bridge's endpoint and domain."""
        self._file = file

    def _configuration(self) -> list[str]:
        """At each start: a test may have given another endpoint."""
        if self._file is not None:
            return [str(self._file)]
        listen = f'listen/endpoints=["{self.endpoint}"]'
        return [str(ROOT / "deploy/bridge.json5"), listen, *self._options]

    def start(self) -> None:
        self._process = Process(
            [
                *("setpriv", "--pdeathsig", "KILL"),  # an aborted run leaves no bridge in its domain
                str(BRIDGE),
                *self._configuration(),
                'plugins/ros2dds/ros_automatic_discovery_range="LOCALHOST"',
            ],
            {"CYCLONEDDS_URI": CYCLONE_ON_LOOPBACK, "ROS_DISTRO": "jazzy"},
        )
        process = self._process
        until(lambda: "running" in process.text or not process.running, "the bridge runs")
        assert process.running, process.text

    @property
    def process(self) -> Process:
        assert self._process is not None
        return self._process

    def kill(self) -> None:
        self.process.kill()

    def freeze(self) -> None:
        self.process.send(signal.SIGSTOP)

    def thaw(self) -> None:
        self.process.send(signal.SIGCONT)

    def end(self) -> None:
        if self._process is not None and self._process.running:
            self.thaw()
            self._process.end()


class RosNode(Commanded):
    """A real rclpy node in its own environment; see `tests/ros_nodes/node.py` for its commands."""

    def __init__(self, domain: int, name: str = "system_controller", **options: Any) -> None:
        super().__init__(
            [ROS_PYTHON, TESTS / "ros_nodes/node.py", name],
            {
                "ROS_DOMAIN_ID": str(domain),
                "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
                "RMW_IMPLEMENTATION": "rmw_fastrtps_cpp",
                "FASTDDS_DEFAULT_PROFILES_FILE": str(ROOT / "deploy/fastdds.xml"),
                "RCUTILS_LOGGING_USE_STDOUT": "0",
                "ROS_LOG_DIR": tempfile.gettempdir(),
            },
            **options,
        )

    def start(self) -> None:
        """Starts the node with a memory limit: Fast DDS may misread a request and allocate a huge
        size."""
        super().start()
        resource.prlimit(self.pid, resource.RLIMIT_DATA, (MOST_MEMORY, MOST_MEMORY))

    def __getattr__(self, name: str) -> Callable[..., Any]:
        def do(*arguments: Any, **named: Any) -> Any:
            return self(name, **dict(zip(ORDERS[name], arguments, strict=False)), **named)

        return do

    def heard_data(self, topic: str) -> list[Any]:
        """The `data` field of all messages that a subscription received."""
        return [message["data"] for message in self.heard(topic)]

    def kill(self) -> None:
        shared = self._shared_memory()
        super().kill()
        for path in shared:
            path.unlink(missing_ok=True)

    def _shared_memory(self) -> set[Path]:
        """The shared memory files that Fast DDS removes at its end: those that this process has
        locked."""
        opened = {path.resolve() for path in Path(f"/proc/{self.pid}/fd").iterdir()}
        locks = {path for path in opened if path.match("/dev/shm/fastdds_*_el")}
        segments = {path.with_name(path.name.removesuffix("_el")) for path in locks}
        return locks | segments | {path.with_name(f"sem.{path.name}_mutex") for path in segments}


def publish_until(
    node: RosNode, topic: str, fields: Mapping[str, Any], is_known: Callable[[], Any]
) -> None:
    """Publishes until the message has arrived: a message of a new publisher on Fast DDS may never
    reach the bridge, even if both have discovered each other."""

    def arrives() -> Any:
        node.publish(topic, fields)
        return is_known()

    until(arrives, f"what is published on {topic} arrives", every_s=0.1)


def publish_and_go(
    node: RosNode, topic: str, type_name: str, fields: Mapping[str, Any], is_known: Callable[[], Any]
) -> None:
    """`publish_until` by a publisher that ends afterwards."""
    node.advertise(topic, type_name)
    publish_until(node, topic, fields, is_known)
    node.withdraw(topic)


def arrives(server: "Server", node: RosNode) -> bool:
    """Whether a press arrives at the node; afterwards none of it is in flight. A message that is sent
    before a Fast DDS node has discovered the bridge's writer never arrives."""
    text = f"there? {secrets.token_hex(4)}"
    if not sends(server, text):
        return False
    with suppress(AssertionError):
        until(lambda: text in node.heard_data("/operation"), "it arrives", ARRIVES_WITHIN_S)
        return True
    return False


def sends(server: "Server", text: str) -> bool:
    """Whether a press is sent: a server that has just stalled refuses it."""
    return bool(server.press("operation", text).json()["outcome"] == "published")


def has_heard(node: RosNode, topic: str, count: int) -> bool:
    return len(node.heard(topic)) >= count


ORDERS: Mapping[str, tuple[str, ...]] = {
    "subscribe": ("topic", "type"),
    "heard": ("topic",),
    "heard_at": ("topic",),
    "serve": ("service", "type", "response"),
    "requested": ("service",),
    "arrivals": ("topic",),
    "toggle": ("topic", "per_s", "for_s"),
    "flood": ("topic", "fields", "per_s", "for_s"),
    "publish_long": ("topic", "length"),
    "advertise": ("topic", "type"),
    "publish": ("topic", "fields"),
    "every": ("topic", "fields", "period_s"),
    "film": ("topic",),
    "once": ("topic", "type", "fields"),
    "withdraw": ("topic",),
    "describe": ("type", "hash"),
    "subscribers": ("topic",),
    "nodes": (),
    "topics": (),
    "endpoints": ("topic",),
}


def http_client(url: str, timeout_s: float = ENOUGH_S, **more: Any) -> httpx.Client:
    """An HTTP client for a test server, without TLS: reading the certificates takes 0.1 s. It leaves an
    idle connection before the server does: a request may be lost on one that closes."""
    more.setdefault("limits", httpx.Limits(keepalive_expiry=2))
    return httpx.Client(base_url=url, timeout=timeout_s, trust_env=False, verify=False, **more)


class Server:
    """The server under uvicorn, as users start it."""

    def __init__(
        self,
        folder: Path,
        port: int = 0,
        *,
        python: str = sys.executable,
        options: Sequence[str] = (),
        app: str = "app.main:app",
        before: Sequence[str] = (),
        **environment: str,
    ) -> None:
        """`before` is a command that starts the server, such as `unshare`. Without KIOSK_DATA it has
        its own data folder, which is removed with it; without KIOSK_PANEL the reference system's panel
        in this checkout, else the panel of its folder."""
        if folder == ROOT:
            environment.setdefault("KIOSK_PANEL", str(REFERENCE))
        self._own_data = tempfile.TemporaryDirectory(prefix="kiosk-data-")
        self.data = Path(environment.setdefault("KIOSK_DATA", self._own_data.name))
        self.base = ""
        self.way = "post"
        self.port = port or free_port()
        self.url = f"http://127.0.0.1:{self.port}"
        self.http = http_client(self.url)
        command = [*before, python, "-m", "uvicorn", app, "--port", str(self.port), *options]
        self.process = Process(command, {**environment, "PYTHONPATH": ""}, cwd=folder)
        try:
            until(self.answers, "the server answers", within_s=60)
        except BaseException:
            self.end(signal.SIGKILL)
            raise

    def robot(self, name: str) -> "Server":
        """The same server, for requests about one of its robots."""
        server = copy(self)
        server.base = f"/robots/{name}"
        return server

    def by(self, way: str) -> "Server":
        """The same server, with presses by "post" or by "socket"."""
        server = copy(self)
        server.way = way
        return server

    def answers(self) -> bool:
        assert self.process.running, self.process.text
        try:
            return self.http.get("/healthz").status_code == 200
        except httpx.TransportError:
            return False

    def ready(self) -> bool:
        return self.http.get("/readyz").status_code == 200

    def snapshot(self) -> dict[str, Any]:
        text = self.http.get(f"{self.base}/events?once=1").text
        content: dict[str, Any] = json.loads(events_in(text)[0][1])
        return content

    def alarms_shown(self, **expected: Any) -> dict[str, Any]:
        """The section of alarms, when it has these values: pages get it some frames after the list has
        changed."""
        section: Any = until(
            lambda: shown if expected.items() <= (shown := self.snapshot()["alarms"]).items() else None,
            f"alarms are shown with {expected}",
        )
        return dict(section)

    def widget(self, name: str) -> dict[str, Any]:
        shown: dict[str, Any] = self.snapshot()["widgets"][name]
        return shown

    def press(self, widget: str, message: str = "", **more: Any) -> httpx.Response:
        """The response to a press, repeated while it is over the rate limit, as programs do."""
        press = {"inputs": {"message": message}, **more}

        def pressed() -> httpx.Response | None:
            answer = self._press(widget, press)
            return None if answer.status_code == 429 else answer

        response: httpx.Response = until(pressed, "there is room for a press", every_s=0.05)
        return response

    def _press(self, widget: str, press: Mapping[str, Any]) -> httpx.Response:
        if self.way == "socket":
            with self.socket() as socket:
                return socket.press(widget=widget, **press)
        return self.http.post(f"{self.base}/widgets/{widget}", json=press)

    @contextmanager
    def socket(self, **headers: str) -> Iterator["PressSocket"]:
        """A press WebSocket of a client with the same cookies."""
        kept = "; ".join(f"{name}={value}" for name, value in self.http.cookies.items())
        headers = {**({"cookie": kept} if kept else {}), **headers}
        host = headers.pop("host", f"127.0.0.1:{self.port}")
        way = socket.create_connection(("127.0.0.1", self.port))
        url = f"ws://{host}{self.base}/presses"
        with connect(url, sock=way, additional_headers=headers, open_timeout=ENOUGH_S) as connection:
            yield PressSocket(connection)

    @contextmanager
    def stream(self) -> Iterator["Stream"]:
        with self.http.stream("GET", f"{self.base}/events", timeout=ENOUGH_S) as response:
            yield Stream(response)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.end()

    def end(self, number: signal.Signals = signal.SIGTERM, timeout_s: float = 25) -> int:
        self.http.close()
        try:
            return self.process.end(number, timeout_s)
        finally:
            self._own_data.cleanup()


class PressSocket:
    """A press WebSocket."""

    def __init__(self, connection: ClientConnection) -> None:
        self._connection = connection

    def say(self, text: str | bytes | list[str]) -> None:
        """Sends a message; a list is one message in fragments."""
        self._connection.send(text)

    def closed(self) -> int:
        """Waits until the server closes the socket; returns the close code."""
        with suppress(ConnectionClosed):
            while True:
                self._connection.recv(10)
        assert self._connection.close_code is not None
        return self._connection.close_code

    def hear(self, timeout_s: float = 10) -> dict[str, Any]:
        said: dict[str, Any] = json.loads(self._connection.recv(timeout_s))
        return said

    def press(self, **press: Any) -> httpx.Response:
        """Makes a press; returns the response as that to a post. No other press may be in flight."""
        self.say(json.dumps({"id": secrets.token_hex(8), **press}))
        return as_response(self.hear())


def as_response(said: dict[str, Any]) -> httpx.Response:
    return httpx.Response(said.pop("status"), json={k: v for k, v in said.items() if k != "press"})


class Stream:
    """The events of one open stream, as (name, data, id)."""

    def __init__(self, response: httpx.Response) -> None:
        self._chunks = response.iter_text()
        self._text = ""

    def next(self, *names: str) -> tuple[str, Any, str]:
        """The next event with one of these names; other events are skipped."""
        while True:
            while "\n\n" not in self._text:
                self._text += next(self._chunks)
            block, self._text = self._text.split("\n\n", 1)
            for name, data, event_id in events_in(block + "\n\n"):
                if name in names:
                    return name, json.loads(data), event_id


def events_in(text: str) -> list[tuple[str, str, str]]:
    """(event, data, id) of each complete event in a text."""
    events = []
    for block in text.split("\n\n"):
        fields = dict(line.split(": ", 1) for line in block.split("\n") if ": " in line)
        if "data" in fields:
            events.append((fields.get("event", ""), fields["data"], fields.get("id", "")))
    return events


def zenoh_file(folder: Path, endpoint: str) -> Path:
    """The shipped zenoh.json5 with another endpoint."""
    shipped = (ROOT / "zenoh.json5").read_text()
    path = folder / "zenoh.json5"
    path.write_text(shipped.replace("tcp/127.0.0.1:7447", endpoint))
    assert endpoint in path.read_text()
    return path


def client_file(folder: Path, *endpoints: str) -> Path:
    """The shipped zenoh.json5 as that of a client of these routers."""
    shipped = (ROOT / "zenoh.json5").read_text()
    path = folder / "zenoh.json5"
    path.write_text(
        shipped.replace('["tcp/127.0.0.1:7447"]', json.dumps(endpoints)).replace('"peer"', '"client"')
    )
    return path


def live(endpoint: str, folder: Path, port: int = 0, **environment: str) -> Server:
    """A server in live mode behind a bridge, with the reference system's panel unless the environment
    names another."""
    zenoh = str(zenoh_file(folder, endpoint))
    return Server(ROOT, port, KIOSK_MODE="live", KIOSK_ZENOH=zenoh, **environment)

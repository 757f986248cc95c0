"""What the kiosk shows while something breaks, and what its process takes: seen from outside."""

import json
import re
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import httpx

from tests.support.parts import ENOUGH_S, Server, events_in, http_client, until

DEAD_AFTER_S: Final = 10.0


@dataclass(frozen=True, slots=True)
class InterlockState:
    """A state of an interlock in the events; `at` in monotonic seconds."""

    at: float
    enabled: bool
    reason: str | None


class Watch:
    """Reads an event stream in a thread, and keeps each state of the interlocks with its time."""

    def __init__(self, server: Server) -> None:
        self.states: dict[str, list[InterlockState]] = {}
        self.widgets: dict[str, dict[str, Any]] = {}
        self.failed = ""
        self._server = server
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()
        until(lambda: self.states or self.failed, "the stream begins")

    def _read(self) -> None:
        try:
            with (
                http_client(self._server.url, 15) as http,
                http.stream("GET", f"{self._server.base}/events") as response,
            ):
                text = ""
                for chunk in response.iter_text():
                    text += chunk
                    blocks, end, text = text.rpartition("\n\n")
                    for name, data, _ in events_in(blocks + end):
                        self._take(name, json.loads(data))
                    if self._over.is_set():
                        return
        except httpx.HTTPError as error:
            self.failed = repr(error)

    def _take(self, name: str, data: dict[str, Any]) -> None:
        now = time.monotonic()
        suffix = "-enabled-updated"
        shown = data["interlocks"] if name == "snapshot" else {}
        if name.endswith(suffix):
            shown = {name.removesuffix(suffix): data}
        for interlock, state in shown.items():
            self.states.setdefault(interlock, []).append(
                InterlockState(now, state["enabled"], state["reason"])
            )
        for widget, state in {"snapshot": data.get("widgets", {}), "update": data}.get(
            name, {}
        ).items():
            self.widgets.setdefault(widget, {}).update(state)

    def now(self, interlock: str) -> InterlockState:
        return self.states[interlock][-1]

    def locked_after(self, since: float, interlock: str, within_s: float, because: str = "") -> float:
        """Seconds from `since` to the first later lock with a reason in which the regular expression
        `because` is found."""

        def lock_state() -> InterlockState | None:
            locks = (s for s in self.states[interlock] if s.at >= since and not s.enabled)
            return next((s for s in locks if re.search(because, s.reason or "")), None)

        lock: InterlockState = until(
            lock_state, f"{interlock} locked, is {self.now(interlock)}", within_s
        )
        return lock.at - since

    def opened(self, interlock: str, within_s: float = ENOUGH_S) -> None:
        try:
            until(lambda: self.now(interlock).enabled, "", within_s)
        except AssertionError:
            raise AssertionError(
                f"{interlock} not open in {within_s} s: {self.now(interlock)}"
            ) from None

    def was_open(self, interlock: str, since: float, to: float) -> bool:
        """Whether the interlock was shown as permitted at any moment in between."""
        states = self.states[interlock]
        shown_at_first = [s for s in states if s.at <= since][-1:]
        return any(s.enabled for s in (*shown_at_first, *(s for s in states if since < s.at <= to)))

    def end(self) -> None:
        self._over.set()
        self._thread.join(5)


@contextmanager
def answering(server: Server) -> Iterator[None]:
    """Within the block, polls the server; aborts one that does not respond, and fails with its stacks.

    The server has to run with `PYTHONFAULTHANDLER=1`: then Python writes all stacks when it is aborted.
    """
    over = threading.Event()
    stood: list[str] = []

    def ask() -> None:
        with http_client(server.url, DEAD_AFTER_S) as http:
            while not over.wait(0.5):
                try:
                    http.get("/healthz")
                except httpx.TimeoutException:
                    stood.append(stacks(server))
                    return
                except httpx.TransportError:
                    continue  # the test has ended the server

    thread = threading.Thread(target=ask, daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join(DEAD_AFTER_S + 5)
        assert not stood, f"no response in {DEAD_AFTER_S:g} s; its stacks:\n{stood[0]}"


def stacks(server: Server) -> str:
    """Aborts a server; returns the stacks of all threads."""
    server.process.send(signal.SIGABRT)
    server.process.wait(10)
    until(lambda: "Current thread" in server.process.text, "the stacks are written", 5)
    return server.process.text


@dataclass(frozen=True, slots=True)
class Resources:
    """The resources of a process."""

    rss_mb: float
    threads: int
    files: int


def resources(pid: int) -> Resources:
    status = dict(
        line.split(":\t", 1)
        for line in Path(f"/proc/{pid}/status").read_text().splitlines()
        if ":\t" in line
    )
    rss_kb = float(status["VmRSS"].split()[0])
    return Resources(
        rss_kb / 1024, int(status["Threads"]), len(list(Path(f"/proc/{pid}/fd").iterdir()))
    )


def until_released(
    pid: int, before: Resources, margin_mb: float, within_s: float = ENOUGH_S
) -> Resources:
    """Waits until memory is within a margin of the value before, and threads and open files are not
    more; a thread, which the first new session of a link starts for all those after it, may be."""

    def released() -> Resources | None:
        now = resources(pid)
        fits = now.threads <= before.threads + 1 and now.files <= before.files
        return now if fits and now.rss_mb <= before.rss_mb + margin_mb else None

    try:
        found_at_last: Resources = until(released, "", within_s, every_s=0.1)
    except AssertionError:
        raise AssertionError(f"was {before}, is {resources(pid)} after {within_s} s") from None
    return found_at_last

"""A trend of 4 pens at 100 Hz: a day's memory and disk, and what recording costs a real server.

`python -m bench.trends` writes `bench/trends.md`. The day is fed to the history directly. The server is
real, behind the real bridge; an rclpy node publishes, a browser's requests are made, and a hold is held
beside it. With QUICK=1 it shows that it works; its figures then mean nothing.
"""

import json
import math
import os
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from websockets.sync.client import connect

from app.cell.history.trends import TrendFile
from app.cell.robot.history import FieldHistory
from app.panel.widgets.trend import history_bytes
from bench.parts import Meter, family, rss_mib
from bench.report.figures import percentile
from tests.support.parts import ROOT, Bridge, RosNode, Server, live, until

QUICK: Final = os.environ.get("QUICK", "") not in ("", "0")
PENS: Final = 4
HZ: Final = 100
DAY_S: Final = 86_400
FED_S: Final = 600 if QUICK else DAY_S
WINDOW_S: Final = 3.0 if QUICK else 60.0
DOMAIN: Final = 96
START: Final = 1_795_000_000.0
FLOAT: Final = "std_msgs/msg/Float64"
BEAT_S: Final = 0.08
PROBE_S: Final = 0.005
VIEWERS: Final = 2

PANEL: Final = """
title = "Trends"
[[interlock]]
id = "enabled"
topic = "/enabled"
type = "std_msgs/msg/Bool"
[[page]]
id = "one"
title = "One"
[[page.widget]]
id = "course"
kind = "trend"
label = "Course"
disk = true
{pens}
[[page.widget]]
id = "jog"
kind = "hold"
label = "Jog"
topic = "/jog"
type = "std_msgs/msg/Bool"
message = {{ data = true }}
release = {{ data = false }}
interlock = "enabled"
"""
PEN: Final = """
[[page.widget.pen]]
topic = "/pen{n}"
type = "std_msgs/msg/Float64"
label = "Pen {n}"
"""


def size_of(field: FieldHistory) -> int:
    """The memory of a history, with what its lists reserve."""
    levels = (field.raw, *field.levels)
    lists = (
        numbers
        for level in levels
        for numbers in (level.at, level.low, level.high, level.last, level.gaps)
    )
    return sum(map(sys.getsizeof, {id(numbers): numbers for numbers in lists}.values()))


def day() -> dict[str, str]:
    """A day fed to the history: memory, time for a sample, questions and the file."""
    fields = [FieldHistory(DAY_S, 5.0) for _ in range(PENS)]
    began = time.process_time()
    for number in range(FED_S * HZ):
        at, value = START + number / HZ, math.sin(number / 500)
        for field in fields:
            field.add(at, value)
    for_each = (time.process_time() - began) / (FED_S * HZ * PENS)
    memory = sum(map(size_of, fields))
    end = START + FED_S
    spans = {}
    for span in (60, 600, 3_600, 86_400):
        began = time.process_time()
        for field in fields:
            list(field.columns(end - span, end, span / 600))
        spans[span] = 1000 * (time.process_time() - began)
    with tempfile.TemporaryDirectory() as folder:
        file = TrendFile(Path(folder))
        for number, field in enumerate(fields):
            rows = {int(level.width): list(level.since(0.0)) for level in field.levels}
            file.write({("", f"/pen{number}", FLOAT, "data"): rows}, {}, end)
        file.close()
        size = sum(path.stat().st_size for path in Path(folder).iterdir())
    return {
        f"memory after {FED_S * HZ * PENS:,} values": f"{memory / 1e6:.1f} MB",
        "what the check says it takes": f"{PENS * history_bytes(DAY_S) / 1e6:.1f} MB",
        "on disk": f"{size / 1e6:.1f} MB",
        "into the history, for each value": f"{1e6 * for_each:.1f} µs",
        "600 columns of 4 pens over 1 min, 10 min, 1 h, 24 h": " / ".join(
            f"{ms:.1f}" for ms in spans.values()
        )
        + " ms",
    }


class Prober:
    """Asks the server's loop for an answer every few milliseconds, in a thread."""

    def __init__(self, server: Server) -> None:
        self.ms: list[float] = []
        self._server = server

    def probe(self, ended: threading.Event) -> None:
        while not ended.wait(PROBE_S):
            began = time.monotonic()
            self._server.http.get("/healthz")
            self.ms.append(1000 * (time.monotonic() - began))


def view(server: Server, ended: threading.Event) -> None:
    """What a page asks for: all once, then what is new twice a second."""
    query: dict[str, float] = {"span_s": 600, "points": 600}
    while not ended.wait(0.5):
        trend = server.http.get("/widgets/course/trend", params=query).json()
        query["since"] = math.floor(trend["end"] / trend["width_s"]) - 3


class Holding:
    """A hold that is held: `ended` is what the server said of it, "" while it is held."""

    def __init__(self, server: Server) -> None:
        self._server = server
        self.beats = 0
        self.ended = ""

    def hold(self, ended: threading.Event) -> None:
        event_id = self._server.snapshot()["id"]
        with connect(f"ws://127.0.0.1:{self._server.port}/widgets/jog/hold") as socket:
            said, at = json.loads(socket.recv()), time.monotonic()

            def say(**message: Any) -> dict[str, Any]:
                after = 1000 * (time.monotonic() - at)
                socket.send(json.dumps({"stamp": said["stamp"], "after": after, **message}))
                heard: dict[str, Any] = json.loads(socket.recv())
                return heard

            said = say(do="begin", inputs={}, seen=event_id)
            lease, at = said.get("lease", ""), time.monotonic()
            while said["state"] == "held" and not ended.wait(BEAT_S):
                self.beats += 1
                said, at = say(do="beat", number=self.beats, lease=lease), time.monotonic()
            if said["state"] != "held":
                self.ended = str(said.get("code") or said["state"])
            else:
                say(do="end", why="released", lease=lease)


@contextmanager
def running(*works: Callable[[threading.Event], None]) -> Iterator[None]:
    """Runs these in threads within the block."""
    ended = threading.Event()
    threads = [threading.Thread(target=work, args=(ended,)) for work in works]
    for thread in threads:
        thread.start()
    try:
        yield
    finally:
        ended.set()
        for thread in threads:
            thread.join()


def measured(server: Server, viewers: int) -> dict[str, str]:
    """The figures of a window of time."""
    prober, holding = Prober(server), Holding(server)
    views = [lambda ended: view(server, ended)] * viewers
    before = rss_mib(family([server.process.pid]))
    with running(prober.probe, holding.hold, *views):
        meter = Meter(lambda: family([server.process.pid]))
        time.sleep(WINDOW_S)
        percent = meter.percent()
    ms = prober.ms
    return {
        "answer of the loop, p50 / p99 / longest": f"{percentile(ms, 50):.1f} / "
        f"{percentile(ms, 99):.1f} / {max(ms):.1f} ms",
        "server": f"{percent:.1f} % of a core",
        "memory grew by": f"{rss_mib(family([server.process.pid])) - before:.1f} MiB",
        "the hold": holding.ended or f"held all the time, {holding.beats} beats",
    }


def recording() -> dict[str, dict[str, str]]:
    """A real server before, while it records, and while it records and two pages look."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "panel.toml").write_text(
            PANEL.format(pens="".join(PEN.format(n=n) for n in range(PENS)))
        )
        bridge = Bridge(DOMAIN)
        bridge.start()
        node = RosNode(DOMAIN)
        server: Server | None = None
        try:
            node.subscribe("/jog", "std_msgs/msg/Bool")
            for number in range(PENS):
                node.advertise(f"/pen{number}", FLOAT)
            node.advertise("/enabled", "std_msgs/msg/Bool")
            node.every("/enabled", {"data": True}, 0.05)
            server = live(bridge.endpoint, folder, KIOSK_PANEL=str(folder / "panel.toml"))
            until(server.ready, "ready", within_s=60)
            until(lambda: server.widget("jog")["enabled"], "the hold is free", within_s=60)
            figures = {"without values": measured(server, 0)}
            for number in range(PENS):
                node.every(f"/pen{number}", {"data": float(number)}, 1 / HZ)
            until(lambda: server.widget("course")["state"] == "live", "values arrive")
            figures["4 × 100 Hz, no page"] = measured(server, 0)
            figures["4 × 100 Hz, two pages"] = measured(server, VIEWERS)
            return figures
        finally:
            if server is not None:
                server.end()
            node.end()
            bridge.end()


def main() -> int:
    rows = day()
    columns = recording()
    lines = ["# Trends", "", f"4 pens of 100 Hz. Load before: {os.getloadavg()[0]:.1f}.", ""]
    lines += ["| a day, fed at once | |", "| --- | --- |"]
    lines += [f"| {name} | {value} |" for name, value in rows.items()]
    lines += ["", f"| {WINDOW_S:g} s of a real server | {' | '.join(columns)} |"]
    lines += [f"| --- |{' --- |' * len(columns)}"]
    for name in next(iter(columns.values())):
        lines.append(f"| {name} | {' | '.join(column[name] for column in columns.values())} |")
    text = "\n".join(lines) + "\n"
    print(text)
    if not QUICK:
        (ROOT / "bench/trends.md").write_text(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())

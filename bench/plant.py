"""A plant on one machine: what a cell, a wall and a router cost, and how panels change over.

    python -m bench.plant [wall] [plant] [robots]      (QUICK=1: smaller, shows that it works)

`wall`: the CPU time and memory of a wall with 100, 300 and 1,000 cells that change each second.
`plant`: 3 routers, 10 panels with 5 robots each, a wall behind a cable that is slow, lossy and cut, in
network namespaces; a router is killed. Needs root. The cable is a program (`tests/faults/wire.py`), as
many kernels lack `tc netem`. All routers are zenohd, as `make bridge` builds it for the tests.
`robots`: 10, 25 and 50 robots, each a process with three topics at 10 Hz, on one server.
"""

import gzip
import json
import os
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any, Final

from tests.faults.net import KIOSK_IP, ROBOT_IP, Cable
from tests.support.cells import Cells, alarm
from tests.support.parts import ROOT, free_port
from tests.support.rmw import router_file, zenohd

QUICK: Final = bool(os.environ.get("QUICK"))
MEASURED_S: Final = 5.0 if QUICK else 20.0
WALLS: Final = (50, 100) if QUICK else (100, 300, 1_000)
FLEETS: Final = (2, 4) if QUICK else (10, 25, 50)
PANELS: Final = 2 if QUICK else 10
ROBOTS_EACH: Final = 5
TICKS: Final = os.sysconf("SC_CLK_TCK")
PAGE_B: Final = os.sysconf("SC_PAGE_SIZE")
TILE: Final = re.compile(rb'<a data-row="c\w+"(?: data-is="(\w+)")?')
ZENOH: Final = (ROOT / "zenoh.json5").read_text()


class Program:
    """A child process, and its CPU time and memory."""

    def __init__(self, *command: str, before: Sequence[str] = (), **env: str) -> None:
        self.child = subprocess.Popen(
            [*before, *command],
            cwd=ROOT,
            env={**os.environ, **env},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )

    @property
    def cpu_s(self) -> float:
        parts = Path(f"/proc/{self.child.pid}/stat").read_text().rpartition(")")[2].split()
        return (int(parts[11]) + int(parts[12])) / TICKS

    @property
    def memory_mib(self) -> float:
        return int(Path(f"/proc/{self.child.pid}/statm").read_text().split()[1]) * PAGE_B / 2**20

    def end(self) -> None:
        self.child.send_signal(signal.SIGTERM)
        with suppress(subprocess.TimeoutExpired):
            self.child.wait(10)
        self.child.kill()
        self.child.wait()


def cores(program: Program, for_s: float = MEASURED_S) -> float:
    """The share of a core that it takes from now on."""
    began, cpu_s = time.monotonic(), program.cpu_s
    time.sleep(for_s)
    return (program.cpu_s - cpu_s) / (time.monotonic() - began)


def until(condition: Callable[[], Any], why: str, within_s: float = 120.0) -> float:
    """Seconds until it holds."""
    began = time.monotonic()
    while not condition():
        if time.monotonic() - began > within_s:
            raise SystemExit(f"not within {within_s:g} s: {why}")
        time.sleep(0.05)
    return time.monotonic() - began


def page(url: str, **headers: str) -> bytes:
    request = urllib.request.Request(url, headers={"accept": "text/html", **headers})
    with urllib.request.urlopen(request, timeout=10) as answer:
        return bytes(answer.read())


def kinds(html: bytes) -> Counter[str]:
    """How many tiles of each kind the page of a wall has."""
    return Counter(kind.decode() or "running" for kind in TILE.findall(html))


def ready(url: str) -> bool:
    with suppress(OSError):
        page(f"{url}/readyz")
        return True
    return False


def router(file: Path, before: Sequence[str] = ()) -> Program:
    return Program(*zenohd("-c", str(file)), before=before)


def zenoh_file(folder: Path, *endpoints: str) -> Path:
    file = folder / "zenoh.json5"
    file.write_text(ZENOH.replace('["tcp/127.0.0.1:7447"]', json.dumps(endpoints)))
    return file


def wall(folder: Path, port: int, *routers: str, before: Sequence[str] = ()) -> Program:
    own = folder / "wall"
    own.mkdir(exist_ok=True)
    return Program(
        *(sys.executable, "-m", "uvicorn", "app.main:app", "--port", str(port)),
        before=before,
        KIOSK_WALL="*",
        KIOSK_ZENOH=str(zenoh_file(own, *routers)),
        KIOSK_DATA=str(own),
    )


@contextmanager
def watched(url: str) -> Iterator[dict[str, int]]:
    """A page that follows the first tiles, as the scripts of a browser do; the bytes of its events."""
    received = {"bytes": 0}
    stream = urllib.request.urlopen(f"{url}/wall/events?first=&last=", timeout=30)
    ended = threading.Event()

    def read() -> None:
        with suppress(OSError, ValueError, AttributeError):
            while not ended.is_set() and (chunk := stream.read1(65_536)):
                received["bytes"] += len(chunk)

    reading = threading.Thread(target=read, daemon=True)
    reading.start()
    yield received
    ended.set()
    reading.join(5)


def measure_wall() -> None:
    """One router and one wall; the cells are of this process."""
    print("wall: cells that change each second")
    for count in WALLS:
        _wall_of(count)


def _wall_of(count: int) -> None:
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        end, port = f"tcp/127.0.0.1:{free_port()}", free_port()
        url = f"http://127.0.0.1:{port}"
        way = router(router_file(folder, "router", end, ()))
        stack.callback(way.end)
        time.sleep(2)
        cells, ended = Cells(end), threading.Event()
        stack.callback(cells.close)
        server = wall(folder, port, end)
        stack.callback(server.end)
        names = [(f"line {number % 10}", f"cell {number}") for number in range(count)]

        def say(names: Sequence[tuple[str, str]] = names, cells: Cells = cells) -> None:
            turn = 0
            while not ended.wait(1.0):
                turn += 1
                for at, (site, cell) in enumerate(names):
                    figure = {"id": "r", "label": "Rate", "text": f"{turn} /h", "unit": "/h"}
                    alarms = [alarm(3, "Label ribbon nearly used up")] if at % 20 == 0 else []
                    figures = [{**figure, "state": "live"}]
                    cells.put(site, cell, figures=figures, alarm_list=alarms)

        saying = threading.Thread(target=say, daemon=True)
        saying.start()
        stack.callback(saying.join)
        stack.callback(ended.set)
        until(lambda: ready(url), "the wall is ready")
        until(lambda: kinds(page(url))["running"] >= count, "all cells are there")
        alone = cores(server)
        with watched(url) as received:
            time.sleep(2)
            before, began = received["bytes"], time.monotonic()
            seen = cores(server)
            rate = (received["bytes"] - before) / (time.monotonic() - began)
        whole = page(url)
        print(
            f"  {count:5} cells: {alone:6.1%} of a core, with a page {seen:6.1%},"
            f" {server.memory_mib:5.0f} MiB; the page {len(whole) / 1000:6.0f} kB,"
            f" packed {len(gzip.compress(whole)) / 1000:5.0f} kB; events {rate / 1000:5.1f} kB/s;"
            f" the router {cores(way, 5.0):6.1%}",
            flush=True,
        )


ROBOT: Final = """
[[robot]]
id = "r{number}"
name = "Robot {number}"
namespace = "/r{number}"
connect = ["{endpoint}"]
"""
PANEL: Final = """
title = "Cell {name}"
mode = "live"
{site}{robots}
[state]
topic = "/state"
type = "std_msgs/msg/String"
states = [{{ value = "RUNNING", text = "RUNNING", shape = "play" }}]
[demo."/state"]
message = {{ data = "RUNNING" }}
hz = 10
[demo."/rate"]
hz = 10
[demo."/load"]
hz = 10
[[page]]
id = "main"
title = "Main"
[[page.widget]]
id = "rate"
kind = "readout"
label = "Rate"
topic = "/rate"
type = "std_msgs/msg/Float64"
field = "data"
[[page.widget]]
id = "load"
kind = "gauge"
label = "Load"
topic = "/load"
type = "std_msgs/msg/Float64"
field = "data"
min = 0
max = 100
"""


def panel_file(folder: Path, name: str, ends: Mapping[int, str], routers: Sequence[str] = ()) -> Path:
    robots = "".join(ROBOT.format(number=number, endpoint=end) for number, end in ends.items())
    site = f'[site]\nname = "line 1"\ncell = "{name}"\nfigures = ["rate"]\n'
    site += f"connect = {json.dumps(routers)}\n"
    file = folder / f"{name}.toml"
    file.write_text(PANEL.format(name=name, site=site if routers else "", robots=robots))
    return file


def robot(panel: Path, end: str, number: int, before: Sequence[str] = ()) -> Program:
    command = (sys.executable, "-m", "app.simulator", str(panel), end, f"/r{number}")
    return Program(*command, before=before)


def server(panel: Path, folder: Path, port: int, before: Sequence[str] = ()) -> Program:
    data = folder / f"data-{panel.stem}"
    command = (sys.executable, "-m", "uvicorn", "app.main:app", "--port", str(port))
    return Program(*command, before=before, KIOSK_PANEL=str(panel), KIOSK_DATA=str(data))


def measure_robots() -> None:
    """Each robot is a process of its own."""
    print("robots: three topics at 10 Hz each, on one server")
    for count in FLEETS:
        with ExitStack() as stack:
            folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
            ends = {number: f"tcp/127.0.0.1:{free_port()}" for number in range(1, count + 1)}
            panel = panel_file(folder, "fleet", ends)
            for number, end in ends.items():
                stack.callback(robot(panel, end, number).end)
            port = free_port()
            panel_server = server(panel, folder, port)
            stack.callback(panel_server.end)
            until(partial(ready, f"http://127.0.0.1:{port}"), "all robots are there")
            time.sleep(3)
            used, memory = cores(panel_server), panel_server.memory_mib
            print(f"  {count:3} robots: {used:6.1%} of a core, {memory:5.0f} MiB", flush=True)


def measure_plant() -> None:
    """Cells with their two routers at one end of a cable, the wall with its own at the other."""
    print(f"plant: 3 routers, {PANELS} panels, {PANELS * ROBOTS_EACH} robots, a wall")
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        cable = Cable()
        stack.callback(cable.end)
        cells, hall = cable.robot, cable.kiosk
        first, second = (f"tcp/{ROBOT_IP}:{port}" for port in (7447, 7448))
        third = f"tcp/{KIOSK_IP}:7447"
        files = [
            router_file(folder, "first", first, ()),
            router_file(folder, "second", second, (first,)),
            router_file(folder, "third", third, (first, second)),
        ]
        ways = [router(file, cells.enter) for file in files[:2]] + [router(files[2], hall.enter)]
        for way in ways:
            stack.callback(way.end)
        time.sleep(2)
        watching = wall(folder, 8000, third, before=hall.enter)
        stack.callback(watching.end)
        servers = []
        for number in range(1, PANELS + 1):
            ends = {r: f"tcp/127.0.0.1:{9000 + number * 10 + r}" for r in range(1, ROBOTS_EACH + 1)}
            panel = panel_file(folder, f"cell {number}", ends, (first, second))
            for robot_number, end in ends.items():
                stack.callback(robot(panel, end, robot_number, cells.enter).end)
            servers.append(server(panel, folder, 8100 + number, cells.enter))
            stack.callback(servers[-1].end)

        def counts() -> Counter[str]:
            with suppress(OSError), hall.inside():
                html = page("http://127.0.0.1:8000")
                return kinds(html)
            return Counter()

        def shown(kind: str) -> bool:
            return counts()[kind] == PANELS

        print(f"  all cells are seen after {until(lambda: shown('running'), 'all run'):.1f} s")
        each = sum(cores(each, 1.0 if QUICK else 3.0) for each in servers) / PANELS
        print(f"  a panel with {ROBOTS_EACH} robots and its summary: {each:.1%} of a core")
        print(f"  the wall {cores(watching):.1%}, the routers", *(f"{cores(w, 3.0):.1%}" for w in ways))
        cable.impair(delay_s=0.05, loss=0.02)
        time.sleep(MEASURED_S)
        print(f"  with 50 ms and 2 % loss each way: {dict(counts())}")
        cable.impair()
        cable.cut()
        print(f"  the cable is cut: no contact after {until(lambda: shown('lost'), 'lost'):.1f} s")
        cable.restore()
        print(f"  it is there again: all run after {until(lambda: shown('running'), 'back'):.1f} s")
        ways[0].child.kill()
        time.sleep(0.2)
        took = until(lambda: shown("running"), "they have changed over")
        print(f"  a router is killed: all run after {took + 0.2:.1f} s")
        time.sleep(MEASURED_S)
        print(f"  {MEASURED_S:g} s later: {dict(counts())}", flush=True)


PHASES: Final = {"wall": measure_wall, "plant": measure_plant, "robots": measure_robots}

if __name__ == "__main__":
    for name in sys.argv[1:] or PHASES:
        PHASES[name]()

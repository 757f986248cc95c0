"""`python -m bench.maps`: what maps cost: how long a large map takes to the screen, how long it keeps
the server from other work, and the CPU time of the server while a robot drives on its map.

The robot speaks Zenoh like one behind a bridge; Chromium shows the page. Needs no bridge and no ROS 2.
With `QUICK=1` some seconds. Prints a table. After `make bench-setup` it has rows of a rival: rosbridge
with a plain page on roslib, and a ROS 2 node.
"""

import math
import os
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

import httpx
import zenoh
from playwright.sync_api import Error as PlaywrightError
from playwright.sync_api import Page, sync_playwright

from app.ros.messages import load_interfaces
from bench.light import Bench, Served
from bench.over_zenoh import OverZenoh
from bench.parts import Meter, family
from bench.peer import Place
from bench.peers import rosbridge_map
from tests.support.parts import CHROMIUM, CHROMIUM_FLAGS, until, zenoh_file

QUICK: Final = bool(os.environ.get("QUICK"))
FOR_S: Final = 3.0 if QUICK else 20.0
SIDE: Final = 1_000 if QUICK else 4_000  # cells of the large map
MIDDLE: Final = 1_000  # cells of the map that the rival shows
RIVAL_S: Final = 10.0  # between two maps of the rival's node, until one is shown
DOMAIN: Final = 77
EVERY_S: Final = 0.005  # between two requests that wait for the event loop
INTERFACES: Final = load_interfaces("jazzy")
TYPES: Final = {
    "map": "nav_msgs/msg/OccupancyGrid",
    "tf": "tf2_msgs/msg/TFMessage",
    "scan": "sensor_msgs/msg/LaserScan",
    "plan": "nav_msgs/msg/Path",
    "costmap": "nav_msgs/msg/OccupancyGrid",
}
MAP: Final = """
title = "Shuttle"
[[page]]
id = "main"
title = "Main"
[[page.widget]]
id = "hall"
kind = "map"
label = "Hall"
"""
LAYERS: Final = """
layer = [
  { shows = "scan", topic = "/scan" },
  { shows = "path", topic = "/plan" },
  { shows = "costmap", topic = "/costmap" },
]
"""
# What is asked of each row, in its unit.
ASKED: Final = {"s to the screen": 1.5, "ms of the event loop": 50.0, "% of a core": 5.0}


class MapRobot(OverZenoh):
    """Publishes messages of `TYPES` by their topics."""

    def __init__(self) -> None:
        super().__init__()
        for topic, type_name in TYPES.items():
            self._publishers[topic] = self._session.declare_publisher(
                topic, congestion_control=zenoh.CongestionControl.BLOCK
            )
            kind = type_name.replace("/", "§")
            token = f"@/{self._zid}/@ros2_lv/MP/{topic}/{kind}/:1:0:0,10"
            self._kept.append(self._session.liveliness().declare_token(token))

    def put(self, topic: str, payload: bytes) -> None:
        self._publishers[topic].put(payload)


def grid(side: int, number: int = 0) -> bytes:
    """A hall with walls, which differs by its number."""
    row = bytes(100 if column % 50 == number % 50 else 0 for column in range(side))
    cells = b"".join(bytes([100]) * side if line % 97 == 0 else row for line in range(side))
    info = {"width": side, "height": side, "resolution": 0.05, "origin": {"orientation": {"w": 1.0}}}
    return INTERFACES.encode(
        TYPES["map"],
        {"header": {"frame_id": "map"}, "info": info, "data": memoryview(cells).cast("b").tolist()},
    )


def transform(t: float) -> bytes:
    sec, part = divmod(t, 1.0)
    moved = {"header": {"stamp": {"sec": int(sec), "nanosec": int(part * 1e9)}, "frame_id": "map"}}
    way = {"translation": {"x": 10 + 5 * math.cos(t), "y": 10.0}, "rotation": {"w": 1.0}}
    stamped = moved | {"child_frame_id": "base_link", "transform": way}
    return INTERFACES.encode(TYPES["tf"], {"transforms": [stamped]})


def scan(t: float) -> bytes:
    """720 beams, as of a usual laser scanner."""
    ranges = [4 + math.sin(beam / 20 + t) for beam in range(720)]
    sec, part = divmod(t, 1.0)
    header = {"stamp": {"sec": int(sec), "nanosec": int(part * 1e9)}, "frame_id": "base_link"}
    limits = {"angle_increment": math.tau / 720, "range_min": 0.1, "range_max": 20.0}
    return INTERFACES.encode(TYPES["scan"], {"header": header, "ranges": ranges, **limits})


def path(t: float) -> bytes:
    poses = [{"pose": {"position": {"x": at / 20, "y": 10 + math.sin(t)}}} for at in range(400)]
    return INTERFACES.encode(TYPES["plan"], {"header": {"frame_id": "map"}, "poses": poses})


class Rate:
    """Publishes messages, each so many times a second, until the block ends."""

    def __init__(self, *streams: tuple[float, Callable[[float], None]]) -> None:
        self._ended = threading.Event()
        self._threads = [threading.Thread(target=self._run, args=stream) for stream in streams]

    def _run(self, hz: float, publish: Callable[[float], None]) -> None:
        due = time.monotonic()
        while not self._ended.wait(max(0.0, due - time.monotonic())):
            publish(time.time())
            due += 1 / hz

    def __enter__(self) -> None:
        for thread in self._threads:
            thread.start()

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        for thread in self._threads:
            thread.join()


class LongestWait:
    """The longest time in which the server answered no request, until the block ends, in ms."""

    def __init__(self, port: int) -> None:
        self.ms = 0.0
        self._http = httpx.Client(base_url=f"http://127.0.0.1:{port}", timeout=20.0)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run)

    def _run(self) -> None:
        while not self._ended.wait(EVERY_S):
            began = time.monotonic()
            self._http.get("/healthz")
            self.ms = max(self.ms, 1000 * (time.monotonic() - began))

    def __enter__(self) -> "LongestWait":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()
        self._http.close()


@contextmanager
def shown(folder: Path, panel: str) -> Iterator[tuple[MapRobot, Served, Page]]:
    """A robot, its panel's server, and a page that shows it."""
    robot = MapRobot()
    bench = Bench(folder)
    file = folder / "map.toml"
    file.write_text(panel)
    try:
        with bench._panel(file, zenoh_file(folder, robot.locator)) as server, sync_playwright() as play:
            server.page()
            until(lambda: server.http.get("/readyz").status_code == 200, "ready")
            browser = play.chromium.launch(executable_path=str(CHROMIUM), args=CHROMIUM_FLAGS)
            page = browser.new_page(viewport={"width": 1280, "height": 800})
            page.goto(f"http://127.0.0.1:{server.port}")
            page.wait_for_selector('[data-state="waiting"]')
            yield robot, server, page
            browser.close()
    finally:
        robot.close()


def wait_for_map(page: Page, but: str = "") -> str:
    """The version of the map that is shown, other than `but`."""
    handle = page.wait_for_function(
        "(but) => { const v = document.querySelector('[data-kind=map]').dataset.version;"
        " return v && v !== but && v; }",
        arg=but,
        polling=10,
    )
    return str(handle.json_value())


def large(folder: Path) -> Iterator[tuple[str, float, str]]:
    first, second = grid(SIDE), grid(SIDE, 7)
    with shown(folder, MAP) as (robot, server, page):
        began = time.monotonic()
        robot.put("map", grid(MIDDLE))
        before = wait_for_map(page)
        yield f"{MIDDLE} x {MIDDLE}, published to shown", time.monotonic() - began, "s to the screen"
        began = time.monotonic()
        robot.put("map", first)
        version = wait_for_map(page, before)
        yield f"{SIDE} x {SIDE}, published to shown", time.monotonic() - began, "s to the screen"
        began = time.monotonic()
        page.reload()
        wait_for_map(page)
        yield f"{SIDE} x {SIDE}, page opened to shown", time.monotonic() - began, "s to the screen"
        with LongestWait(server.port) as waiting:
            time.sleep(1.0)
            idle = waiting.ms
            waiting.ms = 0.0
            robot.put("map", second)
            wait_for_map(page, version)
        yield "longest answer of a request meanwhile", waiting.ms, "ms of the event loop"
        yield "the same without a map", idle, "ms of the event loop"


def load(folder: Path) -> Iterator[tuple[str, float, str]]:
    hall = bytearray(grid(1_000))
    turn = 0

    def next_map(_: float) -> None:
        """None is the same as one before, of which pictures are kept."""
        nonlocal turn
        turn += 1
        hall[-7 * turn] = 50
        robot.put("map", bytes(hall))

    def measured(server: Served) -> float:
        time.sleep(2.0)
        began, before = time.monotonic(), server.cpu()
        time.sleep(FOR_S)
        return 100 * (server.cpu() - before) / (time.monotonic() - began)

    def move(t: float) -> None:
        robot.put("tf", transform(t))

    with shown(folder, MAP) as (robot, server, page):
        robot.put("map", bytes(hall))
        wait_for_map(page)
        yield "at rest, page open", measured(server), "% of a core"
        with Rate((10, move)):
            own = Meter(browser_pids)
            yield "pose at 10 Hz", measured(server), "% of a core"
            yield "the same, browser", own.percent(), "% of a core in the browser"
        with Rate((10, move), (1, next_map)):
            before = wait_for_map(page)
            wait_for_map(page, before)  # it changes
            yield "pose at 10 Hz, map of 1000 x 1000 at 1 Hz", measured(server), "% of a core"
    with shown(folder, MAP + LAYERS) as (robot, server, page):
        robot.put("map", bytes(hall))
        wait_for_map(page)
        cost = [grid(100, number) for number in range(2)]
        streams: list[tuple[float, Callable[[float], None]]] = [
            (50, move),
            (10, lambda t: robot.put("scan", scan(t))),
            (1, lambda t: robot.put("plan", path(t))),
            (1, lambda t: robot.put("costmap", cost[int(t) % 2])),
        ]
        with Rate(*streams):
            name = "transforms at 50 Hz, scan at 10 Hz, path and costmap at 1 Hz"
            yield name, measured(server), "% of a core"


def rival(folder: Path) -> Iterator[tuple[str, float, str]]:
    """rosbridge in Rust with a page on roslib; none without `make bench-setup`."""
    if not rosbridge_map.is_installed():
        return
    place = Place("", DOMAIN, folder)
    with rosbridge_map.served(place, MIDDLE) as (node, server), sync_playwright() as play:
        browser = play.chromium.launch(executable_path=str(CHROMIUM), args=CHROMIUM_FLAGS)
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        page.goto(server.url)
        page.wait_for_selector("[data-ready=true]")
        shown = 0
        while not shown:  # until the subscription has reached the node
            node.order("map")
            shown = maps_shown(page, 0, RIVAL_S)
        time.sleep(1.0)
        shown = maps_shown(page, 0, RIVAL_S)
        began = time.monotonic()
        node.order("map")
        maps_shown(page, shown, 10 * RIVAL_S)
        name = f"rosbridge + roslib: {MIDDLE} x {MIDDLE}, published to shown"
        yield name, time.monotonic() - began, "s to the screen"
        node.order("drive")
        time.sleep(2.0)
        meter, own = Meter(lambda: family(server.pids)), Meter(browser_pids)
        time.sleep(FOR_S)
        yield "rosbridge + roslib: pose at 10 Hz", meter.percent(), "% of a core"
        yield "the same, browser", own.percent(), "% of a core in the browser"
        browser.close()


def maps_shown(page: Page, but: int, within_s: float) -> int:
    """How many maps the rival's page has shown, when there are more; `but` if there are no more."""
    try:
        handle = page.wait_for_function(
            "(but) => { const n = Number(document.querySelector('main').dataset.maps);"
            " return n > but && n; }",
            arg=but,
            polling=10,
            timeout=1000 * within_s,
        )
    except PlaywrightError:
        return but
    return int(str(handle.json_value()))


def browser_pids() -> list[int]:
    """The processes of Chromium that this program has started."""
    return [pid for pid in family([os.getpid()]) if "chrom" in os.readlink(f"/proc/{pid}/exe")]


def main() -> None:
    print("| what | measured | asked |\n| --- | --- | --- |", flush=True)
    for rows in (large, load, rival):
        with tempfile.TemporaryDirectory() as folder:
            for name, value, unit in rows(Path(folder)):
                asked = f"{ASKED[unit]:g}" if unit in ASKED and rows is not rival else ""
                print(f"| {name} | {value:.2f} {unit} | {asked} |", flush=True)


if __name__ == "__main__":
    main()

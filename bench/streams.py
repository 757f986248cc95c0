"""`python -m bench.streams`: what a camera and a busy log cost the server, and whether a hold suffers.

A real node films 640 × 480 in raw colours at 15 Hz and writes 1,000 lines a second to /rosout, over the
real bridge. Two browsers look at the camera and the log, while a hold is held. With `QUICK=1` it takes
some seconds, to check that it works. Prints JSON.
"""

import json
import os
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

from playwright.sync_api import Page, sync_playwright
from websockets.sync.client import connect

from bench.parts import family, rss_mib
from tests.support.panel_text import OPERATION
from tests.support.parts import CHROMIUM_FLAGS, HEADLESS, Bridge, RosNode, Server, live, until

DOMAIN: Final = 98
FOR_S: Final = 5.0 if os.environ.get("QUICK") else 60.0
SETTLE_S: Final = 3.0
FRAMES_HZ: Final = 15.0
LINES_HZ: Final = 1000.0
BEAT_S: Final = 0.08
LOWER: Final = 10  # steps of niceness
PAGES: Final = """
[[page]]
id = "one"
title = "One"
[[page.widget]]
id = "camera"
kind = "camera"
label = "Camera"
topic = "/film"
type = "sensor_msgs/msg/Image"
[[page.widget]]
id = "log"
kind = "log"
label = "Log"
[[page.widget]]
id = "jog"
kind = "hold"
label = "Jog"
topic = "/jog"
type = "geometry_msgs/msg/Point"
message = { x = 1, y = 0, z = 0 }
release = { x = 0, y = 0, z = 0 }
rate_hz = 20
interlock = "operation"
[[page]]
id = "two"
title = "Two"
"""
PANEL: Final = f'title = "Streams"\n{OPERATION}{PAGES}'


def main() -> None:
    with ExitStack() as stack:
        bridge = Bridge(DOMAIN)
        bridge.start()
        stack.callback(bridge.end)
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="bench-streams-")))
        (folder / "panel.toml").write_text(PANEL)
        panel = str(folder / "panel.toml")
        server = live(bridge.endpoint, folder, app="bench.stalls:app", KIOSK_PANEL=panel)
        stack.callback(server.end)
        with after_the_server():
            robot, filming = RosNode(DOMAIN, "robot"), RosNode(DOMAIN, "camera")
        for node in (robot, filming):
            stack.callback(node.end)
        _offer(robot, filming)
        until(lambda: _permitted(server, robot), "the robot permits", every_s=0.2)
        idle = _measured(server, SETTLE_S)  # without browsers; the log comes all the same
        with after_the_server():
            browser = stack.enter_context(sync_playwright()).chromium
            chromium = browser.launch(executable_path=HEADLESS, args=CHROMIUM_FLAGS)
        stack.callback(chromium.close)
        pages = [chromium.new_page() for _ in range(2)]
        for page in pages:
            page.goto(server.url)
            page.locator('[data-widget="camera"][data-frame]').wait_for()
        time.sleep(SETTLE_S)
        looked = _loaded(server, robot, filming, pages)
        for page in pages:
            page.goto(f"{server.url}/pages/two")
        print(json.dumps({"no browser": idle, "two browsers": looked}, indent=2))


@contextmanager
def after_the_server() -> Iterator[None]:
    """What is started within the block gets the processor after the server, as its unit says:
    nodes and browsers that draw without a graphics card take all of two cores."""
    before = os.getpriority(os.PRIO_PROCESS, 0)
    os.setpriority(os.PRIO_PROCESS, 0, before + LOWER)
    try:
        yield
    finally:
        os.setpriority(os.PRIO_PROCESS, 0, before)


def _offer(robot: RosNode, filming: RosNode) -> None:
    robot.advertise("/operation_enabled", "std_msgs/msg/Bool")
    robot.subscribe("/jog", "geometry_msgs/msg/Point", depth=1000)
    filming.advertise("/film", "sensor_msgs/msg/Image", reliability="best_effort", depth=1)
    filming.film("/film", width=640, height=480, hz=FRAMES_HZ)
    filming.advertise("/rosout", "rcl_interfaces/msg/Log", durability="transient_local", depth=1000)


def _permitted(server: Server, robot: RosNode) -> bool:
    robot.publish("/operation_enabled", {"data": True})
    return bool(server.widget("jog")["enabled"])


def _measured(server: Server, for_s: float) -> dict[str, Any]:
    """Of the server during `for_s`: memory at both ends, processor time, its loop's longest turn."""
    pids = family((server.process.pid,))
    server.http.get("/stalls")
    rest, ticks = rss_mib(pids), _ticks(server.process.pid)
    time.sleep(for_s)
    used = _ticks(server.process.pid) - ticks
    return {
        "rss_mib": [round(rest, 1), round(rss_mib(pids), 1)],
        "cpu_percent": round(100 * used / os.sysconf("SC_CLK_TCK") / for_s, 1),
        "stall": server.http.get("/stalls").json(),
    }


def _loaded(server: Server, robot: RosNode, filming: RosNode, pages: list[Page]) -> dict[str, Any]:
    """The same with lines and a hold; frames and lines that each browser got, and the hold's gaps."""
    sent: list[int] = []
    line = {"level": 20, "name": "robot", "msg": "line {n} of a log that says a little more than that"}

    def flood() -> None:
        sent.append(filming.flood("/rosout", line, LINES_HZ, FOR_S))

    flooding = threading.Thread(target=flood)
    frames = [_frame(page) for page in pages]
    lines = int(server.widget("log")["count"])
    heard = len(robot.heard("/jog"))
    with _held(server) as ends:
        flooding.start()
        figures = _measured(server, FOR_S)
        flooding.join()
    at = robot.heard_at("/jog")[heard:]
    return figures | {
        "frames_per_s": [
            round((_frame(page) - first) / FOR_S, 1) for page, first in zip(pages, frames, strict=True)
        ],
        "lines": [sent[0], int(server.widget("log")["count"]) - lines],
        "rows": [page.locator(".line").count() for page in pages],
        "hold": {
            "messages": len(at),
            "longest_gap_ms": round(1000 * max((b - a for a, b in pairwise(at)), default=0.0)),
            "ended": ends,
        },
    }


def _frame(page: Page) -> int:
    return int(page.locator('[data-widget="camera"]').get_attribute("data-frame") or 0)


def _ticks(pid: int) -> int:
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return int(fields[11]) + int(fields[12])


@contextmanager
def _held(server: Server) -> Iterator[list[str]]:
    """Holds within the block; the codes of its end, which is a release if nothing else ended it."""
    ends: list[str] = []
    over = threading.Event()

    def hold() -> None:
        url = f"ws://127.0.0.1:{server.port}/widgets/jog/hold"
        with connect(url, proxy=None) as socket:
            said = json.loads(socket.recv(10))
            at, number, lease = time.monotonic(), 0, ""
            begin = {"do": "begin", "inputs": {}, "seen": server.snapshot()["id"]}
            while said.get("state") not in ("ended", "refused"):
                message = {"do": "beat", "number": number, "lease": lease} if lease else begin
                if over.is_set():
                    message = {"do": "end", "why": "released", "lease": lease}
                after = 1000 * (time.monotonic() - at)
                socket.send(json.dumps({**message, "stamp": said["stamp"], "after": after}))
                said = json.loads(socket.recv(10))
                at, number, lease = time.monotonic(), number + 1, said.get("lease", lease)
                over.wait(BEAT_S)
            ends.append(said["code"])

    holding = threading.Thread(target=hold)
    holding.start()
    try:
        yield ends
    finally:
        over.set()
        holding.join()


if __name__ == "__main__":
    main()

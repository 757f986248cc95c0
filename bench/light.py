"""`python -m bench.light [ROW…]`: what the server costs beside the least that its libraries take.

The floors are `bench/peers/bare`: a page by FastAPI, Zenoh and Jinja, a press by a POST and a put,
subscribers whose callback does nothing. Each figure is CPU time (or memory) of both in the same run, in
turn or in the same window. The rows of the kiosk are times by the clock, with Chromium without windows
and without a compositor; their floor is Chromium that shows a page from a file. Needs no bridge; with
`QUICK=1` some seconds. Prints a table; `python -m bench light` writes it with the other results.
"""

import json
import math
import os
import statistics
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import Any, Final

import httpx

from app.tools.kiosk.browser import FLAGS
from bench.light_rows import ABSOLUTE, ASKED, asked
from bench.over_zenoh import Load, OverZenoh
from bench.parts import KIOSK_PYTHON, pss_mib
from tests.support.browser.screen import HEADLESS_FLAGS, KioskScreen, evaluated
from tests.support.parts import (
    CHROMIUM,
    ROOT,
    SHIPPED,
    Process,
    free_port,
    http_client,
    until,
    zenoh_file,
)
from tests.web.test_first_page import THREE

QUICK: Final = bool(os.environ.get("QUICK"))
ROUNDS: Final = 1 if QUICK else 7
FOR_S: Final = 2.0 if QUICK else 15.0
PRESSES: Final = 20 if QUICK else 300
ROBOTS: Final = 5 if QUICK else 50
SETTLE_S: Final = 2.0 if QUICK else 6.0
STARTS: Final = 1 if QUICK else 5  # of a kiosk
PAUSE_S: Final = 0.03  # between two presses: fewer than a client may
BARE: Final = ROOT / "bench/peers/bare"
TEXT: Final = "std_msgs/msg/String"
READOUT: Final = """
[[page.widget]]
id = "{id}"
kind = "readout"
label = "{id}"
topic = "/{id}"
type = "std_msgs/msg/String"
"""
BUTTON: Final = """
[[page.widget]]
id = "start"
kind = "publish"
label = "Start"
topic = "/operation1"
type = "std_msgs/msg/String"
message = { data = "go" }
"""
ONE_PAGE: Final = 'title = "Cell"\n[[page]]\nid = "{id}"\ntitle = "Main"\n'
ROBOT: Final = '[[robot]]\nid = "r{n}"\nname = "R{n}"\nnamespace = "/r{n}"\n'


# When a page was painted first, in seconds since the epoch; null before.
PAINTED: Final = """(() => {
  const paint = performance.getEntriesByName("first-contentful-paint")[0];
  return paint ? (performance.timeOrigin + paint.startTime) / 1000 : null;
})()"""
WAITS: Final = f"document.body?.dataset.waiting === undefined ? null : {PAINTED}"
PRESSABLE: Final = """(() => {
  const button = document.querySelector("[data-widget=start] button");
  const live = window.operatorPanel && operatorPanel.eventAgeMs() < 2000;
  return live && button && !button.disabled && button.ariaDisabled !== "true";
})()"""


def cpu_s(pid: int) -> float:
    """The CPU time of a process and all its threads, in ns of resolution."""
    return time.clock_gettime((~pid << 3) | 2)


class Served:
    """A server until the block ends; `port` is free before. The panel is the installed one of
    `make bench`, else that of this checkout."""

    def __init__(self, folder: Path, app: str, **environment: str) -> None:
        self.port = free_port()
        python = KIOSK_PYTHON if KIOSK_PYTHON.exists() else sys.executable
        where = folder if KIOSK_PYTHON.exists() or app != "app.main:app" else ROOT
        options = ["--port", str(self.port), "--log-level", "warning", "--no-access-log"]
        options += ["--app-dir", str(BARE)] if app == "app:app" else []
        command = [str(python), "-m", "uvicorn", app, *options]
        new = {"PYTHONPATH": "", "PYTHONUNBUFFERED": "1"}  # not forked from another, as in tests
        self.process = Process(command, {**environment, **new}, cwd=where)
        self.http = http_client(f"http://127.0.0.1:{self.port}", 20.0)

    def page(self) -> None:
        """Waits for the first page."""
        until(self._answers, "the first page", every_s=0.02)

    def _answers(self) -> bool:
        assert self.process.running, self.process.text
        try:
            return self.http.get("/", follow_redirects=True).status_code == 200
        except httpx.TransportError:
            return False

    def cpu(self) -> float:
        return cpu_s(self.process.pid)

    def __enter__(self) -> "Served":
        return self

    def __exit__(self, *_: object) -> None:
        self.http.close()
        self.process.end()


class Bench:
    """The rows; each returns (this panel, its floor) in the unit of the row."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._three = self._file("three.toml", THREE)

    def _file(self, name: str, text: str) -> Path:
        path = self._folder / name
        path.write_text(text)
        return path

    def _panel(self, panel: Path, zenoh: Path, mode: str = "live", data: str = "data") -> Served:
        return Served(
            self._folder,
            "app.main:app",
            KIOSK_PANEL=str(panel),
            KIOSK_ZENOH=str(zenoh),
            KIOSK_MODE=mode,
            KIOSK_DATA=str(self._folder / data),
        )

    def _bare(self, zenoh: Path, topics: list[str] | None = None) -> Served:
        topics_text = json.dumps(topics or [])
        return Served(self._folder, "app:app", KIOSK_ZENOH=str(zenoh), BENCH_TOPICS=topics_text)

    def _nobody(self) -> Path:
        """A configuration that leads to no robot."""
        return zenoh_file(self._folder, f"tcp/127.0.0.1:{free_port()}")

    def _start(self, panel: Path, mode: str) -> tuple[float, float]:
        spent: list[list[float]] = [[], []]
        zenoh = self._nobody()
        servers: list[Callable[[], Served]] = [
            partial(self._panel, panel, zenoh, mode, mode),
            partial(self._bare, zenoh),
        ]
        for turn in range(ROUNDS + 1):
            for times, served in zip(spent, servers, strict=True):
                with served() as server:
                    server.page()
                    if turn:  # the first one writes bytecode
                        times.append(server.cpu())
        return statistics.median(spent[0]), statistics.median(spent[1])

    def start_three(self) -> tuple[float, float]:
        return self._start(self._three, "live")

    def start_shipped(self) -> tuple[float, float]:
        return self._start(SHIPPED, "demo")

    def memory(self) -> tuple[float, float]:
        zenoh = self._nobody()
        with self._panel(self._three, zenoh) as panel, self._bare(zenoh) as bare:
            for server in (panel, bare):
                server.page()
            time.sleep(SETTLE_S)
            return pss_mib([panel.process.pid]), pss_mib([bare.process.pid])

    def press(self) -> tuple[float, float]:
        """In ms for each, without what the servers take beside."""
        with ExitStack() as stack:
            robot = OverZenoh()
            stack.callback(robot.close)
            zenoh = zenoh_file(self._folder, robot.locator)
            file = self._file("button.toml", ONE_PAGE.format(id="a") + BUTTON)
            panel = stack.enter_context(self._panel(file, zenoh))
            bare = stack.enter_context(self._bare(zenoh))
            for server in (panel, bare):
                server.page()
            until(lambda: panel.http.get("/readyz").status_code == 200, "ready")
            time.sleep(SETTLE_S)
            at, idle = time.monotonic(), (panel.cpu(), bare.cpu())
            time.sleep(FOR_S)
            beside = [
                (server.cpu() - before) / (time.monotonic() - at)
                for server, before in zip((panel, bare), idle, strict=True)
            ]
            spent = [0.0, 0.0]
            for _ in range(4):
                for number, (server, path) in enumerate(((panel, "/widgets/start"), (bare, "/press"))):
                    at, before = time.monotonic(), server.cpu()
                    for _ in range(PRESSES // 4):
                        answer = server.http.post(path, json={"inputs": {}})
                        assert answer.json()["outcome"] == "published", answer.text
                        time.sleep(PAUSE_S)
                    over = (time.monotonic() - at) * beside[number]
                    spent[number] += server.cpu() - before - over
        count = PRESSES // 4 * 4
        return 1000 * spent[0] / count, 1000 * spent[1] / count

    def _topics(self, text: str, topics: list[str], hz: float, watched: bool) -> tuple[float, float]:
        """In µs for each message, in one window."""
        with ExitStack() as stack:
            robot = OverZenoh()
            stack.callback(robot.close)
            for topic in topics:
                robot.offer(f"/{topic}")
            zenoh = zenoh_file(self._folder, robot.locator)
            panel = stack.enter_context(self._panel(self._file("topics.toml", text), zenoh))
            bare = stack.enter_context(self._bare(zenoh, topics))
            for server in (panel, bare):
                server.page()
            until(lambda: panel.http.get("/readyz").status_code == 200, "ready")
            if watched:
                stack.enter_context(watching(panel))
            says = [partial(robot.say, f"/{topic}") for topic in topics]
            load = Load(says, hz, 32)
            time.sleep(SETTLE_S)
            before, sent = (panel.cpu(), bare.cpu()), len(load.put_at)
            time.sleep(FOR_S)
            after, count = (panel.cpu(), bare.cpu()), len(load.put_at) - sent
            load.end()
        return 1e6 * (after[0] - before[0]) / count, 1e6 * (after[1] - before[1]) / count

    def khz(self) -> tuple[float, float]:
        return self._topics(ONE_PAGE.format(id="a") + READOUT.format(id="t0"), ["t0"], 1000, True)

    def hundred_hz(self) -> tuple[float, float]:
        return self._topics(ONE_PAGE.format(id="a") + READOUT.format(id="t0"), ["t0"], 100, True)

    def unseen(self) -> tuple[float, float]:
        topics = [f"t{number}" for number in range(200)]
        text = ONE_PAGE.format(id="a") + "".join(READOUT.format(id=topic) for topic in topics)
        return self._topics(text, topics, 20, False)

    def _idle(self, panel: Served, bare: Served) -> tuple[float, float]:
        """In % of a core."""
        for server in (panel, bare):
            server.page()
        time.sleep(SETTLE_S)
        at, before = time.monotonic(), (panel.cpu(), bare.cpu())
        time.sleep(FOR_S)
        spent = time.monotonic() - at
        return 100 * (panel.cpu() - before[0]) / spent, 100 * (bare.cpu() - before[1]) / spent

    def idle_shipped(self) -> tuple[float, float]:
        zenoh = self._nobody()
        with self._panel(SHIPPED, zenoh, "demo", "demo") as panel, self._bare(zenoh) as bare:
            return self._idle(panel, bare)

    def idle_robots(self) -> tuple[float, float]:
        """The robots are peers of their own, in this process."""
        with ExitStack() as stack:
            robots = [OverZenoh(f"/r{number}") for number in range(ROBOTS)]
            for robot in robots:
                stack.callback(robot.close)
            entries = "".join(
                ROBOT.format(n=number) + f'connect = ["{robot.locator}"]\n'
                for number, robot in enumerate(robots)
            )
            text = f'title = "Cells"\n{entries}[[page]]\nid = "a"\ntitle = "Main"\noverview = true\n'
            zenoh = self._nobody()
            panel = stack.enter_context(self._panel(self._file("robots.toml", text), zenoh))
            bare = stack.enter_context(self._bare(zenoh))
            return self._idle(panel, bare)

    def _painted(self) -> float:
        """Seconds from Chromium's start to a page from a file on its screen."""
        page = self._file("page.html", "<!doctype html><title>Page</title><body>Page")
        profile, port = self._folder / f"chromium-{time.monotonic()}", free_port()
        began = time.time()
        command = [str(CHROMIUM), *HEADLESS_FLAGS, f"--remote-debugging-port={port}"]
        command += [flag for flag in FLAGS if flag != "--remote-debugging-pipe"]
        command += [f"--user-data-dir={profile}", f"--app={page.as_uri()}"]
        chromium = Process(command, {})
        try:
            look = partial(evaluated, port, PAINTED)
            painted: float = until(look, "a page is shown", every_s=0.02)
        finally:
            chromium.end()
        return painted - began

    def _kiosk(self) -> tuple[float, float]:
        """Seconds from the start of the server and the screen at once: to the waiting page on the
        screen, and to a button that can be pressed."""
        with ExitStack() as stack:
            robot = OverZenoh()
            stack.callback(robot.close)
            folder = Path(stack.enter_context(tempfile.TemporaryDirectory(dir=self._folder)))
            file = self._file("button.toml", ONE_PAGE.format(id="a") + BUTTON)
            zenoh = zenoh_file(self._folder, robot.locator)
            began, at = time.time(), time.monotonic()
            server = stack.enter_context(self._panel(file, zenoh))
            screen = KioskScreen(
                f"http://127.0.0.1:{server.port}",
                folder / "run",
                "--compositor=none",
                f"--panel={file}",
            )
            stack.callback(screen.end)
            waited: list[float] = []

            def live() -> bool:
                if not waited and (painted := screen.evaluate(WAITS)):
                    waited.append(painted - began)
                return bool(screen.evaluate(PRESSABLE))

            until(live, "a button can be pressed", every_s=0.02)
            return waited[0] if waited else math.nan, time.monotonic() - at

    def _kiosks(self, number: int) -> tuple[float, float]:
        took = [(self._kiosk()[number], self._painted()) for _ in range(STARTS + 1)][1:]
        panel, floor = zip(*took, strict=True)
        return statistics.median(panel), statistics.median(floor)

    def kiosk_waiting(self) -> tuple[float, float]:
        return self._kiosks(0)

    def kiosk_live(self) -> tuple[float, float]:
        return self._kiosks(1)


@contextmanager
def watching(server: Served) -> Iterator[None]:
    """A client that reads the events."""
    over = threading.Event()

    def read() -> None:
        with server.http.stream("GET", "/events", timeout=None) as response:
            for _ in response.iter_raw():
                if over.is_set():
                    return

    thread = threading.Thread(target=read, daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()


Row = tuple[str, str, Callable[[Bench], tuple[float, float]]]
# (name, unit, measurement)
ROWS: Final[tuple[Row, ...]] = (
    ("start, three widgets", "s", Bench.start_three),
    ("start, shipped panel", "s", Bench.start_shipped),
    ("a press", "ms", Bench.press),
    ("1 kHz on a shown topic", "µs", Bench.khz),
    ("100 Hz on a shown topic", "µs", Bench.hundred_hz),
    ("200 topics at 20 Hz, unseen", "µs", Bench.unseen),
    ("memory at rest, three widgets", "MiB", Bench.memory),
    ("idle, shipped panel", "%", Bench.idle_shipped),
    ("idle, 50 robots", "%", Bench.idle_robots),
    ("kiosk, to the waiting page", "s by the clock", Bench.kiosk_waiting),
    ("kiosk, to a live button", "s by the clock", Bench.kiosk_live),
)


def steps(wanted: Callable[[str], bool] = lambda name: True) -> Iterator[tuple[str, dict[str, Any]]]:
    """Each row by its name: this panel, its floor, what is asked."""
    for name, unit, measure in ROWS:
        if not wanted(name):
            continue
        with tempfile.TemporaryDirectory(prefix="bench-light-", ignore_cleanup_errors=True) as folder:
            panel, floor = measure(Bench(Path(folder)))
        judged = panel if unit in ABSOLUTE else panel / floor
        yield (
            name,
            {
                "unit": unit,
                "panel": round(panel, 3),
                "floor": round(floor, 3),
                "ratio": round(panel / floor, 2),
                "asked": ASKED[name],
                "reached": judged <= ASKED[name],
            },
        )


def main() -> None:
    words = sys.argv[1:]
    print("| row | this panel | floor | ratio | asked |\n| --- | --- | --- | --- | --- |")
    for name, row in steps(lambda name: not words or any(word in name for word in words)):
        unit = row["unit"]
        cells = (
            name,
            f"{row['panel']:g} {unit}",
            f"{row['floor']:g} {unit}",
            f"{row['ratio']:g} ×",
            asked(row),
        )
        print(f"| {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()

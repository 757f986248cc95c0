"""A flood of alarms: presses and a hold go on beside it, the list stays readable, memory is bounded. A
server that is killed between the raise of an alarm and its acknowledgement loses neither."""

import random
import signal
import statistics
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, Final

import pytest

from app.cell.alarms.shown import MAX_ROWS
from tests.faults.results import ms, record
from tests.faults.watch import resources
from tests.support.form import several
from tests.support.holds import PATIENT
from tests.support.parts import ROOT, Server, live, until
from tests.support.servers import panel_file, ready
from tests.web.test_alarms import HEALTHY, act, history, listed, server_with
from tests.web.test_hold_socket import opened

pytestmark = [pytest.mark.long("fault"), pytest.mark.promise("alarms")]

RAISED: Final = 1_000
DEFINED: Final = 10_000
STATUSES: Final = 300
FLOOD_S: Final = several(4, 30)
PRESS_EVERY_S: Final = 0.02
BEAT_S: Final = 0.1
MARGIN_MB: Final = 120.0
# Times those without a flood, of the longest press and of half of them; a busy machine takes up to
# `LATEST_S` and `HALF_S`.
TIMES: Final = 2.0
LATEST_S: Final = 2.0
HALF_S: Final = 0.15
KILLS: Final = several(3, 50)
LONGEST_LIFE_S: Final = 1.0
Occurrence = tuple[str, int]  # the alarm's id, and how often it was raised
NOW_AND_THEN: Final = "values = [4.5, 6.0], period_s = 0.8"
HEAD: Final = """
title = "Flood"
[[page]]
id = "main"
title = "Main"
[[page.widget]]
id = "press"
kind = "publish"
label = "Press"
topic = "/pressed"
type = "std_msgs/msg/Bool"
message = { data = true }
[[page.widget]]
id = "jog"
kind = "hold"
label = "Jog"
interlock = "permit"
topic = "/held"
type = "std_msgs/msg/Bool"
message = { data = true }
release = { data = false }
[[interlock]]
id = "permit"
label = "permit"
topic = "/permit"
max_age_s = 5.0
[[alarm]]
id = "health"
diagnostics = "*"
"""
ALARM: Final = """
[[alarm]]
id = "a%d"
topic = "%s"
type = "std_msgs/msg/Float64"
text = "Alarm %d"
low = 5.0
"""


def panel() -> str:
    topics = ["/level"] * RAISED + ["/quiet"] * (DEFINED - RAISED - 1)
    return HEAD + "".join(ALARM % (number, topic, number) for number, topic in enumerate(topics))


class Robot:
    """The robot that floods, in its own process."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self._process = process
        assert process.stdout is not None
        self.endpoint = process.stdout.readline().strip()

    def told(self, word: str) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(f"{word}\n")
        self._process.stdin.flush()


@contextmanager
def robot() -> Iterator[Robot]:
    command, pipe = [sys.executable, "-m", "tests.support.flood_robot"], subprocess.PIPE
    with subprocess.Popen(command, cwd=ROOT, text=True, stdin=pipe, stdout=pipe) as process:
        try:
            yield Robot(process)
        finally:
            process.kill()


@pytest.fixture
def flooding() -> Iterator[Robot]:
    with robot() as mine:
        yield mine


@pytest.fixture
def server(flooding: Robot, tmp_path: Path) -> Iterator[Server]:
    path = str(panel_file(tmp_path, panel()))
    with ready(live(flooding.endpoint, tmp_path, KIOSK_PANEL=path, app=PATIENT)) as mine:
        yield mine


def press_for(server: Server, seconds: float) -> list[float]:
    """How long each of the presses took that were made in this time."""
    took, end = [], time.monotonic() + seconds
    while time.monotonic() < end:
        began = time.monotonic()
        assert server.http.post("/widgets/press", json={"inputs": {}}).json()["outcome"] == "published"
        took.append(time.monotonic() - began)
        time.sleep(PRESS_EVERY_S)
    return took


@contextmanager
def held(server: Server) -> Iterator[list[str]]:
    """A hold that beats within the block; yields the states that the server says of it."""
    states: list[str] = []
    over = threading.Event()
    with opened(server) as socket:
        states.append(socket.begin(inputs={})["state"])

        def beat() -> None:
            while not over.wait(BEAT_S) and states[-1] == "held":
                states.append(socket.beat()["state"])

        thread = threading.Thread(target=beat, daemon=True)
        thread.start()
        try:
            yield states
        finally:
            over.set()
            thread.join()


def standing(server: Server) -> int:
    return int(server.snapshot()["alarms"]["standing"])


@pytest.mark.long("real time")
def test_presses_a_hold_and_the_list_go_on_in_a_flood(server: Server, flooding: Robot) -> None:
    until(lambda: standing(server) == 0, "nothing is raised", within_s=60)
    press_for(server, 0.5)
    quiet, before = press_for(server, 2.0), resources(server.process.pid)
    with held(server) as states:
        flooding.told("diagnostics")
        flooding.told("low")
        flood = press_for(server, FLOOD_S)
        until(lambda: standing(server) >= RAISED, "all are raised", within_s=60, every_s=0.2)
    assert (states[-1], len(states) > FLOOD_S) == ("held", True)
    alarms = server.snapshot()["alarms"]
    assert (len(alarms["rows"]), alarms["more"] + MAX_ROWS) == (MAX_ROWS, alarms["standing"])
    assert alarms["flood"]
    page = server.http.get("/alarms", headers={"accept": "text/html"}).text
    assert page.count('<li class="alarm"') <= MAX_ROWS + 1  # the template of a row is one
    after = resources(server.process.pid)
    ratio, longest = max(flood) / max(quiet), ms(max(flood))
    half, half_in_flood = statistics.median(quiet), statistics.median(flood)
    print(
        f"presses: {ms(max(quiet))} at most when quiet, {longest} in the flood, {ratio:.1f} times;",
        f"half of them within {ms(half)}, {ms(half_in_flood)};",
        f"memory {before.rss_mb:.0f} MB, then {after.rss_mb:.0f} MB",
    )
    record(
        f"{RAISED} alarms raised at once of {DEFINED}, {STATUSES} diagnostics at 10 Hz",
        presses=len(flood),
        latest=f"{longest}, without a flood {ms(max(quiet))}; "
        f"half of them within {ms(half_in_flood)}, without {ms(half)}",
        after=f"{after.rss_mb - before.rss_mb:+.0f} MB",
    )
    assert max(flood) < max(TIMES * max(quiet), LATEST_S)
    assert half_in_flood < max(TIMES * half, HALF_S)
    assert after.rss_mb - before.rss_mb < MARGIN_MB


def acknowledge_for(server: Server, seconds: float, answered: set[Occurrence]) -> set[Occurrence]:
    """Acknowledges what is shown in this time; returns what was shown as raised, by its id and
    occurrence."""
    shown, end = set(), time.monotonic() + seconds
    while time.monotonic() < end:
        for row in listed(server).values():
            occurrence = row["id"], int(row["occurrence"])
            shown.add(occurrence)
            if not row["acknowledged"]:
                answer = act(server, row["id"], "acknowledge", occurrence=row["occurrence"]).json()
                if answer["done"] and not answer["reason"]:
                    answered.add(occurrence)
    return shown


def raised_anew(server: Server, shown: set[Occurrence]) -> bool:
    """Whether an alarm stands that was not shown in an earlier life: those of before still stand."""
    return any((row["id"], int(row["occurrence"])) not in shown for row in listed(server).values())


def events(server: Server) -> Iterator[dict[str, Any]]:
    """The whole history, the newest first."""
    before: dict[str, int] = {}
    while True:
        page = history(server, limit=500, **before)
        yield from page["history"]
        if page["older"] is None:
            return
        before = {"before": page["older"]}


def test_kills_between_raise_and_acknowledgement_lose_neither(tmp_path: Path) -> None:
    seed = random.randrange(10**9)
    chance, data = random.Random(seed), tmp_path / "data"
    shown: set[Occurrence] = set()
    answered: set[Occurrence] = set()
    for _ in range(KILLS):
        server = server_with(tmp_path, NOW_AND_THEN, data=data)
        try:
            until(partial(raised_anew, server, shown), "an alarm is raised, that none of before is")
            shown |= acknowledge_for(server, chance.uniform(0, LONGEST_LIFE_S), answered)
        finally:
            server.end(signal.SIGKILL)
    with server_with(tmp_path, HEALTHY, data=data) as server:
        kept = list(events(server))
    raised = {(row["id"], row["occurrence"]) for row in kept if row["event"] == "raised"}
    done = {(row["id"], row["occurrence"]) for row in kept if row["event"] == "acknowledged"}
    assert shown - raised == set(), seed
    assert answered - done == set(), seed
    assert len(raised) >= KILLS
    for alarm in ("air_low", "air_latched"):
        numbers = [row["occurrence"] for row in kept if (row["id"], row["event"]) == (alarm, "raised")]
        assert numbers == sorted(set(numbers), reverse=True), seed
    record(
        f"server killed between raise and acknowledgement, {KILLS} times",
        after=f"{len(raised)} raises and {len(done)} acknowledgements, none lost",
    )

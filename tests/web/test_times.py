"""Times on a whole server, in the hour that its clock shows twice."""

import re
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.support.parts import ROOT, Server

MINUTES_S = 600


@pytest.fixture
def kiosk(tmp_path: Path) -> Iterator[Server]:
    """Its summer time ended ten minutes ago: the clock was set back by an hour."""
    ended = time.gmtime(time.time() - MINUTES_S + 3600)  # as the clock shows it in summer
    clock = time.strftime("%H:%M:%S", ended)
    zone = f"WINTER0SUMMER-1,0/0,{ended.tm_yday - 1}/{clock}"
    # A new process, which reads its time zone at the start.
    with Server(ROOT, KIOSK_MODE="demo", TZ=zone, PYTHONUNBUFFERED="1") as mine:
        yield mine


def test_each_time_has_its_offset(kiosk: Server) -> None:
    receipt = kiosk.press("operation", "twice").json()
    twice = r"\d\d:\d\d:\d\d(\.\d{3})? \+00:00"
    assert re.search(twice, receipt["reason"]), receipt
    home, log = kiosk.http.get("/").text, kiosk.http.get("/log").text
    clock = rf'<time id="clock" datetime="[^"]+\+00:00">{twice}</time>'
    assert re.search(clock, home)
    assert re.search(rf'<td><time datetime="20[^"]+\+00:00">{twice}</time>', log)
    assert re.search(r"T\d\d:\d\d:\d\d\.\d{3}\+00:00,", kiosk.http.get("/log.csv").text)

"""Browsers that do not read, two hundred browsers, and short connections: no other client is
delayed."""

import time
from concurrent.futures import ThreadPoolExecutor

import pytest

from tests.faults import fixtures
from tests.faults.browsers import Browsers, asking, storm, unread
from tests.faults.presser import Presser, accounted
from tests.faults.results import ms, record
from tests.faults.rig import TEXT, Rig, limit
from tests.faults.trial import presses_work
from tests.faults.watch import Watch, answering, resources, until_released
from tests.support.form import several
from tests.support.parts import ENOUGH_S, Server, until

pytestmark = [pytest.mark.long("fault"), pytest.mark.promise("reconnect")]

rig = fixtures.rig
server = fixtures.server

READS_NOTHING_S = several(10, 60)
STORM_S = several(3, 30)
BROWSERS = 200
UPDATES_PER_S = 200.0
MOST_UNREAD = 400_000  # what the server and the kernel on both sides hold
MARGIN_MB = 40.0


def test_a_browser_that_reads_nothing(rig: Rig, server: Server) -> None:
    """It costs no queue, and when it reads again it receives the current state."""
    rig.robot.advertise("/heard", TEXT)
    until(lambda: rig.robot.subscribers("/heard"), "the bridge listens")
    watch = Watch(server)
    before = resources(server.process.pid)
    presser = Presser(server, "guarded")
    with answering(server), ThreadPoolExecutor(1) as pool, asking(server) as deaf:
        presses_work(presser)
        said = {"data": "{n} " + "long " * 30}
        telling = pool.submit(rig.robot.flood, "/heard", said, UPDATES_PER_S, READS_NOTHING_S)
        until(telling.done, "the time is over", READS_NOTHING_S + ENOUGH_S)
        rig.robot.publish("/heard", {"data": "now"})
        until(lambda: watch.widgets["heard"]["text"] == "now", "who reads sees it", limit(2))
        presses_work(presser)
        got = unread(deaf)
    presses = presser.end()
    rig.robot.withdraw("/heard")
    watch.end()
    assert len(got) < MOST_UNREAD
    assert b'"text":"now"' in got
    account = accounted(presses, lambda: rig.arrivals("guarded"), lambda _: True, limit(2.0))
    until_released(server.process.pid, before, MARGIN_MB)
    record(
        f"a browser that reads nothing for {READS_NOTHING_S} s",
        presses=account,
        latest=ms(account.latest_s),
        after=f"{len(got) // 1000} kB were waiting for it, then it showed what was so",
    )


def test_two_hundred_browsers(rig: Rig, server: Server) -> None:
    before = resources(server.process.pid)
    presser = Presser(server, "paced")
    browsers = Browsers(server, BROWSERS)
    with answering(server):
        until(lambda: browsers.showing(b"event: snapshot") == BROWSERS, "each has a snapshot")
        presses_work(presser)
        browsers.forget()
        published_at = time.monotonic()
        rig.robot.publish("/kept", {"data": False})
        until(lambda: browsers.showing(b'"enabled":false') == BROWSERS, "each is locked", limit(5))
        locked_s = time.monotonic() - published_at
        rig.robot.publish("/kept", {"data": True})
        until(lambda: browsers.showing(b'"enabled":true') == BROWSERS, "each is open", limit(5))
    presses = presser.end()
    browsers.close()
    account = accounted(presses, lambda: rig.arrivals("paced"), lambda _: True, limit(2.0))
    after = until_released(server.process.pid, before, MARGIN_MB)
    record(
        f"{BROWSERS} browsers at once",
        locked=f"{ms(locked_s)}, in the last of them",
        presses=account,
        latest=ms(account.latest_s),
        after=f"{after.rss_mb - before.rss_mb:+.0f} MB, no more threads, no more files",
    )


def test_browsers_that_come_and_go(rig: Rig, server: Server) -> None:
    storm(server, 1.0)
    watch = Watch(server)
    before = resources(server.process.pid)
    presser = Presser(server, "guarded")
    with answering(server):
        presses_work(presser)
        times = storm(server, STORM_S)
        presses_work(presser)
    presses = presser.end()
    account = accounted(presses, lambda: rig.arrivals("guarded"), lambda _: True, limit(2.0))
    after = until_released(server.process.pid, before, MARGIN_MB)
    watch.end()
    record(
        f"{times} streams opened and dropped in {STORM_S} s",
        presses=account,
        latest=ms(account.latest_s),
        after=f"{after.rss_mb - before.rss_mb:+.0f} MB, no more threads, no more files",
    )

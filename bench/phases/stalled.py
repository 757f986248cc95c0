"""A stalled browser: its processes are stopped, as when a lid is closed. Measures the server's memory,
the latency of other clients, and the age of what it shows first afterwards."""

import os
import signal
import time
from contextlib import ExitStack
from typing import Any, Final

from bench.browser import Watched
from bench.parts import family, rss_mib
from bench.peer import Peer
from bench.report.figures import percentile, shown_after, toggles_matched
from bench.rig import Rig

LARGE: Final = "/t0"
SMALL: Final = "/t1"
LOADS: Final = {LARGE: (100.0, 20_000), SMALL: (1000.0, 16)}  # Hz, bytes
AFTER_S: Final = 4.0
GAP_S: Final = (0.04, 0.06)
OLD_S: Final = 0.5  # values this old at the end of the stall count as old
SETTLE_S: Final = 1.0


def stalled(rig: Rig, peer: Peer) -> dict[str, Any]:
    """The figures of one peer."""
    topics = tuple(LOADS)
    with ExitStack() as stack:
        still = stack.enter_context(rig.another_chromium())
        server = stack.enter_context(rig.running(peer, topics))
        other = stack.enter_context(rig.page(peer, server, peer.robot, topics))
        sleeper = stack.enter_context(still.page(server.url, peer.shown, topics, keep=True))
        rig.permit(peer.robot, sleeper)
        other.watch()
        for topic, (hz, size) in LOADS.items():
            rig.robot("load", ways=[peer.robot], topics=[topic], hz=hz, size=size)
        time.sleep(SETTLE_S)
        before, _ = _others(rig, peer, other, rig.sizes.before_stall_s, server.pids)
        rest_mib = rss_mib(family(server.pids))
        pids = still.pids()
        stack.callback(_signal, pids, signal.SIGCONT)  # before its browser is closed
        _signal(pids, signal.SIGSTOP)
        during, most_mib = _others(rig, peer, other, rig.sizes.stalled_s, server.pids)
        went_on_ns = time.monotonic_ns()
        _signal(pids, signal.SIGCONT)
        time.sleep(AFTER_S)
        put_at = rig.robot("quiet")
        clock = sleeper.clock()
        texts = [(clock.ns(at), put_at[topic][number_of(text)]) for at, topic, text in sleeper.kept()]
        first_ms, old = shown_after(texts, went_on_ns, OLD_S)
        return {
            "before_p50": percentile(before, 50),
            "before_p99": percentile(before, 99),
            "during_p50": percentile(during, 50),
            "during_p99": percentile(during, 99),
            "grown_mib": most_mib - rest_mib,
            "after_mib": rss_mib(family(server.pids)) - rest_mib,
            "first_ms": first_ms,
            "old": old,
        }


def _others(
    rig: Rig, peer: Peer, page: Watched, for_s: float, pids: tuple[int, ...]
) -> tuple[list[float], float]:
    """(latencies in ms, maximum of the server's memory) of another page during `for_s`."""
    clock = page.clock()
    page.take("toggles")
    said: list[tuple[float, bool]] = []
    most = 0.0
    end = time.monotonic() + for_s
    while time.monotonic() < end:
        more = rig.robot("toggle", way=peer.robot, count=20, least_s=GAP_S[0], most_s=GAP_S[1])
        said += [(at / 1e6, value) for at, value in more]
        most = max(most, rss_mib(family(pids)))
    time.sleep(SETTLE_S)
    shown = [(clock.ns(at) / 1e6, value) for at, value in page.take("toggles")]
    page.take("texts")
    return list(toggles_matched(said, shown).ms), most


def number_of(text: str) -> int:
    """The number in a text of the robot; see `bench/robot.py`."""
    return int(text[1:10])


def _signal(pids: set[int], number: signal.Signals) -> None:
    for pid in pids:
        try:
            os.kill(pid, number)
        except ProcessLookupError:
            continue

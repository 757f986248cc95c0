"""The cost of a server and a browser: CPU time in % of one core, resident memory in MiB."""

import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from typing import Any, Final
from urllib.parse import urlsplit

from bench.parts import Meter, crowd, family, rss_mib
from bench.peer import Peer, Running
from bench.report.figures import percentile
from bench.rig import Rig, scratch
from bench.unattended import Unattended
from tests.support.processes.commanded import Commanded

RATES: Final = (0, 100, 1000)
TOPIC: Final = "/t0"
WIDE: Final = tuple(f"/t{number}" for number in range(100))
WIDE_HZ: Final = 50.0
CROWD_HZ: Final = 10.0
SIZE: Final = 32  # bytes of a text
SETTLE_S: Final = 1.0


Figures = dict[str, float]


def cost(rig: Rig, peer: Peer) -> Figures:
    """All costs of one peer."""
    return single(rig, peer) | wide(rig, peer) | many(rig, peer)


def single(rig: Rig, peer: Peer, router: str = "") -> Figures:
    """One topic and one page, at the second start in a folder: memory at rest, and the cost by rate."""
    topics = (TOPIC,)
    with ExitStack() as stack:
        folder = stack.enter_context(scratch(peer))
        with rig.running(peer, topics, router, folder=folder):
            pass
        server = stack.enter_context(rig.running(peer, topics, router, folder=folder))
        browser = stack.enter_context(rig.unattended(peer, server, topics))
        time.sleep(SETTLE_S)
        figures = {"rest_mib": rss_mib(family(server.pids))}
        for hz in RATES:
            figures |= loaded(rig, peer, server, browser, topics, hz, f"{hz}")
        return figures


def wide(rig: Rig, peer: Peer) -> Figures:
    """A hundred topics on one page."""
    with rig.running(peer, WIDE) as server, rig.unattended(peer, server, WIDE) as browser:
        time.sleep(SETTLE_S)
        return loaded(rig, peer, server, browser, WIDE, WIDE_HZ, "wide")


def loaded(
    rig: Rig,
    peer: Peer,
    server: Running,
    browser: Unattended,
    topics: Sequence[str],
    hz: float,
    name: str,
) -> Figures:
    """The cost of server and browser while the robot publishes at `hz`."""
    if hz:
        rig.robot("load", ways=[peer.robot], topics=list(topics), hz=hz, size=SIZE)
        time.sleep(SETTLE_S / 2)
    servers, shown = Meter(lambda: family(server.pids)), Meter(browser.pids)
    time.sleep(rig.sizes.window_s)
    figures = {
        f"server_{name}": servers.percent(),
        f"browser_{name}": shown.percent(),
        f"rss_{name}": rss_mib(family(server.pids)),
    }
    rig.robot("quiet")
    return figures


def many(rig: Rig, peer: Peer) -> Figures:
    """The cost of bare streams beside one page, all on one topic; empty if only a page can connect."""
    topics = (TOPIC,)
    with rig.running(peer, topics) as server, rig.page(peer, server, peer.robot, topics):
        all_figures: Figures = {}
        if server.bare is None:
            return all_figures
        with crowd() as clients:
            for count in rig.sizes.crowds:
                join(clients, server, count)
                figures = crowded(rig, peer.robot, server, clients, count)
                all_figures |= {f"{name}_{count}": figure for name, figure in figures.items()}
        return all_figures


def join(clients: Commanded, server: Running, count: int) -> None:
    """Connects clients until there are `count`."""
    assert server.bare is not None
    page = urlsplit(server.url).port or 80
    clients(
        "join",
        count=count,
        port=server.bare.port or page,
        kind=server.bare.kind,
        path=server.bare.path,
        say=[said for said in server.bare.say if isinstance(said, str)],
        say_bytes=[said.hex() for said in server.bare.say if isinstance(said, bytes)],
        id_pattern=server.bare.id_pattern,
        answers=server.bare.answers,
    )


def crowded(rig: Rig, way: str, server: Running, clients: Commanded, count: int) -> Figures:
    """The figures of a crowd at `CROWD_HZ`."""
    time.sleep(SETTLE_S)
    clients("forget")
    rig.robot("load", ways=[way], topics=[TOPIC], hz=CROWD_HZ, size=SIZE)
    meter = Meter(lambda: family(server.pids))
    time.sleep(rig.sizes.window_s)
    used = meter.percent()
    put_at = rig.robot("quiet")[0]
    time.sleep(SETTLE_S / 2)
    received: Mapping[str, Any] = clients("came")
    ms = [(at - put_at[number]) / 1e6 for number, at in received["came"] if number < len(put_at)]
    return {
        "p50": percentile(ms, 50),
        "p99": percentile(ms, 99),
        "crowd": used,
        "mib": rss_mib(family(server.pids)),
        "came": len(ms) / (count * len(put_at)),
        "cut": received["lost"],
    }

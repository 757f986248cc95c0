"""`python -m bench [PHASE…]`: measures, and writes the results as JSON, Markdown and a picture.

Results are saved after each measurement, so that a failing phase loses nothing. With `QUICK=1` only a
few samples are measured, to check that the harness works.
"""

import argparse
import os
import signal
import sys
import time
import traceback
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from functools import partial
from pathlib import Path
from types import FrameType
from typing import Any, Final

from bench import flood, light
from bench.kiosk import Kiosk
from bench.peer import Peer
from bench.peers import PEERS
from bench.peers.check import fault_of
from bench.phases import latency
from bench.phases.cost import cost
from bench.phases.dialects import BRIDGE, RMW, dialect
from bench.phases.growth import Growth
from bench.phases.stalled import stalled
from bench.phases.start import start
from bench.report.store import Store
from bench.report.tables import write
from bench.rig import QUICK, Rig, Sizes
from tests.support.parts import ROOT

KIOSK: Final = Kiosk()
SAME_STREAM: Final = ("plain-ws",)  # same event stream as another peer: only its presses differ
AGAIN: Final = "-again"  # the floor measured twice, as a control

Measure = Callable[[Rig, Peer], Mapping[str, Any]]


class Run:
    """The phases, on the available peers."""

    def __init__(self, rig: Rig, store: Store, peers: Sequence[Peer]) -> None:
        self._rig = rig
        self._store = store
        self._peers = peers
        self._rounds = rig.sizes.rounds

    def down(self) -> None:
        floor = next(peer for peer in self._peers if peer.id == "floor")
        measured = [(peer.id, peer) for peer in self._peers] + [(floor.id + AGAIN, floor)]
        self._interleaved("down", measured, latency.down, self._rounds)

    def bridge(self) -> None:
        """Latency down, from rclpy over the real bridge."""
        with self._rig.bridge() as locator:
            self._interleaved(
                "bridge",
                [(p.id, p) for p in self._peers if p.robot == "zenoh" and p.id not in SAME_STREAM],
                partial(latency.down, over="ros", router=locator),
                self._rounds,
            )

    def up(self) -> None:
        pressed = [(peer.id, peer) for peer in self._peers if peer.button]
        self._interleaved("up", pressed, latency.up, self._rounds)

    def cost(self) -> None:
        self._interleaved("cost", self._shown(), cost, self._rig.sizes.cost_rounds)

    def stalled(self) -> None:
        self._interleaved("stalled", self._shown(), stalled, 1)

    def start(self) -> None:
        self._interleaved("start", [(peer.id, peer) for peer in self._peers], start, self._rounds)

    def growth(self) -> None:
        self._store.begin("growth")
        for axis, measure in Growth(self._rig).axes().items():
            with timed(f"growth: {axis}"), self._store.faults(f"growth: {axis}"):
                self._store.add("growth", 0, axis, {"points": measure()})

    def dialects(self) -> None:
        """This panel over the bridge and on rmw_zenoh."""
        with self._rig.bridge() as bridge, self._rig.router() as router:
            measure = partial(dialect, routers={BRIDGE.id: bridge, RMW.id: router})
            both = [(peer.id, peer) for peer in (BRIDGE, RMW)]
            self._interleaved("dialects", both, measure, self._rounds)

    def flood(self) -> None:
        """Presses of this panel beside a flood of alarms."""
        self._store.begin("flood")
        with timed("flood"), self._store.faults("flood"):
            for name, figures in flood.steps():
                self._store.add("flood", 0, name, figures)

    def light(self) -> None:
        """What this panel costs beside the least that its libraries take."""
        self._store.begin("light")
        with timed("light"), self._store.faults("light"):
            for name, figures in light.steps():
                self._store.add("light", 0, name, figures)

    def _shown(self) -> list[tuple[str, Peer]]:
        """The peers whose pages show texts, each event stream once."""
        return [(p.id, p) for p in self._peers if p.button and p.id not in SAME_STREAM]

    def _interleaved(
        self, phase: str, peers: Sequence[tuple[str, Peer]], measure: Measure, rounds: int
    ) -> None:
        """Measures each peer once per round, in a rotating order."""
        self._store.begin(phase)
        for turn in range(rounds):
            first = turn * len(peers) // rounds
            for name, peer in (*peers[first:], *peers[:first]):
                step = f"{phase}: {name}"
                with timed(f"{step}, round {turn + 1}"), self._store.faults(step):
                    self._store.add(phase, turn, name, measure(self._rig, peer))


PHASES: Final = (
    *("down", "bridge", "up", "cost", "stalled", "start", "growth", "dialects", "flood", "light"),
)


@contextmanager
def timed(step: str) -> Iterator[None]:
    """Prints what is being measured, and the time it took."""
    print(step, end=" ", flush=True)
    began = time.monotonic()
    yield
    print(f"({time.monotonic() - began:.1f} s)", flush=True)


def proven(rig: Rig, store: Store, peers: Iterable[Peer]) -> list[Peer]:
    """The peers that work. For the others, the reason is stored."""
    ready_peers = []
    for peer in peers:
        if not peer.installed():
            store.fault(peer.id, "not installed: `make bench-setup` does it")
            continue
        with store.faults(peer.id), rig.running(peer) as server, rig.chromium.blank() as page:
            if fault := fault_of(peer, server, (), rig.robot, page):
                store.fault(peer.id, fault)
            else:
                ready_peers.append(peer)
    return ready_peers


@contextmanager
def ended_like_ctrl_c() -> Iterator[None]:
    """Within the block, SIGTERM raises KeyboardInterrupt, so that all processes are ended."""

    def on_signal(number: int, frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    previous = signal.signal(signal.SIGTERM, on_signal)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, previous)


def main(arguments: Sequence[str]) -> int:
    quick = os.environ.get("QUICK", "") not in ("", "0")
    parser = argparse.ArgumentParser(prog="python -m bench", description=__doc__.split("\n")[0])
    parser.add_argument("phases", nargs="*", metavar="PHASE", help=", ".join(PHASES))
    parser.add_argument("--peers", help="ids with commas between; this panel and the floor always are")
    parser.add_argument("--results", type=Path, default=ROOT / "bench", help="folder to write to")
    parser.add_argument("--page", type=Path, help="page whose section is written again")
    options = parser.parse_args(arguments)
    if unknown := set(options.phases) - set(PHASES):
        parser.error(f"no such phase: {', '.join(sorted(unknown))}; there are {', '.join(PHASES)}")
    wanted = options.peers.split(",") if options.peers else [peer.id for peer in PEERS]
    rivals = [peer for peer in PEERS if peer.id in (*wanted, "floor")]
    options.results.mkdir(parents=True, exist_ok=True)
    store = Store(options.results / "results.json")
    sizes = QUICK if quick else Sizes()
    try:
        with ended_like_ctrl_c(), Rig(sizes) as rig:
            store.machine(rig.chromium.version, asdict(sizes) | {"quick": quick})
            run = Run(rig, store, [KIOSK, *proven(rig, store, rivals)])
            for phase in options.phases or PHASES:
                getattr(run, phase)()
    except KeyboardInterrupt:
        print("interrupted; the results so far are kept", file=sys.stderr)
        return 130
    except Exception:
        traceback.print_exc()
        return 1
    finally:
        titles = {peer.id: peer.title for peer in (KIOSK, BRIDGE, RMW, *PEERS)}
        write(store.results, titles, options.results, options.page)
    return 1 if failures(store.results["faults"]) else 0


def failures(faults: Mapping[str, str]) -> list[str]:
    """What ends a run with exit status 1, each printed: a fault of this panel, and a rival that is not
    installed or does not work. A rival may fail in a measurement."""
    measured = tuple(f": {peer.id}" for peer in PEERS if peer.id != "floor")
    counted = [where for where in faults if not where.endswith(measured)]
    for where in counted:
        print(f"failed: {where}: {faults[where]}", file=sys.stderr)
    return counted


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

"""The targets, compared with the results of the same run."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from bench.report.figures import Slope, ratio, slope
from bench.report.store import Results, figure

KIOSK: Final = "kiosk"
FLOOR: Final = "floor"
FLOOR_AGAIN: Final = "floor-again"
PLAIN: Final = "plain"
MB_PER_MIB: Final = 1.048576
CROWD: Final = 500
NOISE_MIB: Final = 1.0  # malloc takes memory in steps


@dataclass(frozen=True)
class Target:
    """A target; `measured` is text, `reached` is None if it was not measured."""

    text: str
    measured: str
    reached: bool | None


def targets(results: Results) -> list[Target]:
    groups = (_down, _up, _costs, _stalled, _start, _dialects)
    return [target for group in groups for target in group(results)]


def best_rival(results: Results, phase: str, name: str) -> tuple[str, float]:
    """(id, value) of the best peer besides this panel and the floor; ("", NaN) without one."""
    rounds = results.get(phase, {}).get("rounds", [])
    peers = {peer for figures in rounds for peer in figures} - {KIOSK, FLOOR, FLOOR_AGAIN}
    rivals = [(figure(results, phase, peer, name), peer) for peer in sorted(peers)]
    known = [rival for rival in rivals if not math.isnan(rival[0])]
    value, peer = min(known, default=(math.nan, ""))
    return peer, value


def _down(results: Results) -> Iterator[Target]:
    p50 = figure(results, "down", KIOSK, "p50")
    p99 = figure(results, "down", KIOSK, "p99")
    rival, theirs = best_rival(results, "down", "p50")
    yield _times("down p50, of the best rival's", ratio(p50, theirs), 1.0, rival)
    yield _times("down p50, of the floor's", ratio(p50, figure(results, "down", FLOOR, "p50")), 1.35)
    yield _times("down p99, of its own p50", ratio(p99, p50), 3.0)


def _up(results: Results) -> Iterator[Target]:
    rival, theirs = best_rival(results, "up", "p50")
    yield _times(
        "up p50, of the best rival's", ratio(figure(results, "up", KIOSK, "p50"), theirs), 1.0, rival
    )


def _costs(results: Results) -> Iterator[Target]:
    def cost(name: str, peer: str = KIOSK) -> float:
        return figure(results, "cost", peer, name)

    yield _below("1 kHz on a topic: server", cost("server_1000"), 4, "% of a core")
    yield _below("1 kHz on a topic: browser", cost("browser_1000"), 4, "% of a core")
    yield _below("100 topics × 50 Hz: server", cost("server_wide"), 20, "% of a core")
    for name, noun in (("p99", "p99"), ("crowd", "server's CPU")):
        of_plain = ratio(cost(f"{name}_{CROWD}"), cost(f"{name}_{CROWD}", PLAIN))
        yield _times(f"{CROWD} clients at 10 Hz: {noun}, of the plain way's", of_plain, 1.0)
    fewest = min(results.get("sizes", {}).get("crowds", [1]))
    each = (cost(f"mib_{CROWD}") - cost(f"mib_{fewest}")) * MB_PER_MIB * 1000 / (CROWD - fewest)
    yield _below(f"{CROWD} clients: memory of each", each, 60, "kB")


def _stalled(results: Results) -> Iterator[Target]:
    first, old = (figure(results, "stalled", KIOSK, name) for name in ("first_ms", "old"))
    measured = f"the first was put {first:.0f} ms before it went on; {old:.0f} old ones"
    unknown = math.isnan(first + old)
    yield Target(
        "after a stall of 30 s: the newest first, no old one after it",
        "–" if unknown else measured,
        None if unknown else old == 0,
    )


def _start(results: Results) -> Iterator[Target]:
    def start(name: str) -> float:
        return figure(results, "start", KIOSK, name)

    rest = figure(results, "cost", KIOSK, "rest_mib") * MB_PER_MIB
    yield _below("memory at rest", rest, 75, "MB")
    yield _below("start to ready", start("ready_s"), 0.8, "s")
    yield _at_most("first page: request to the robot's state", start("shown_ms"), 150, "ms")
    yield _at_most("first page: bytes in all", start("bytes") / 1000, 30, "kB")


def _dialects(results: Results) -> Iterator[Target]:
    names = {"down_p50": "down p50", "up_p50": "up p50", "server_1000": "server at 1 kHz"}
    for name, noun in names.items():
        bridge, rmw = (
            figure(results, "dialects", peer, name) for peer in ("kiosk-bridge", "kiosk-rmw")
        )
        yield _times(f"on rmw_zenoh: {noun}, of the bridge's", ratio(rmw, bridge), 1.0)


def _times(text: str, measured: float, limit: float, rival: str = "") -> Target:
    shown = f"{measured:.2f} ×" + (f" ({rival})" if rival else "")
    return _judged(f"{text}: at most {limit:g} ×", shown, measured, measured <= limit)


def _below(text: str, measured: float, limit: float, unit: str) -> Target:
    shown = f"{measured:.3g} {unit}"
    return _judged(f"{text}: under {limit:g} {unit}", shown, measured, measured < limit)


def _at_most(text: str, measured: float, limit: float, unit: str) -> Target:
    shown = f"{measured:.3g} {unit}"
    return _judged(f"{text}: at most {limit:g} {unit}", shown, measured, measured <= limit)


def _judged(text: str, shown: str, measured: float, reached: bool) -> Target:
    return Target(text, "–", None) if math.isnan(measured) else Target(text, shown, reached)


@dataclass(frozen=True)
class Axis:
    """An axis of growth, with the unit in which it is counted."""

    text: str
    unit: str
    per: float = 1.0  # slopes are given per this many units


AXES: Final = {
    "topics": Axis("topics, 20 Hz each", "topic"),
    "rate": Axis("rate of one topic", "100 Hz", 100),
    "size": Axis("size of a message, 20 Hz", "10 kB", 10_000),
    "widgets": Axis("widgets of one topic, 20 Hz", "widget"),
    "clients": Axis("clients, 10 Hz", "client"),
    "robots": Axis("robots, 20 Hz each", "robot"),
}


@dataclass(frozen=True)
class Grown:
    """The results of one axis: its values, the costs there, and their slopes."""

    axis: Axis
    xs: tuple[float, ...]
    cpu: tuple[float, ...]
    mib: tuple[float, ...]
    cpu_slope: Slope
    mib_slope: Slope


def grown(results: Results) -> list[Grown]:
    rounds = results.get("growth", {}).get("rounds") or [{}]
    return [_grown(axis, rounds[0][name]["points"]) for name, axis in AXES.items() if name in rounds[0]]


def _grown(axis: Axis, points: list[list[float]]) -> Grown:
    xs, cpu, mib, noise = (tuple(column) for column in zip(*points, strict=True))

    def fitted(ys: tuple[float, ...], doubt: float) -> Slope:
        return slope(list(zip(xs, ys, strict=True)), doubt)

    return Grown(axis, xs, cpu, mib, fitted(cpu, max(noise)), fitted(mib, NOISE_MIB))

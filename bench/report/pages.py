"""The figures of the last benchmark in README.md and docs/comparison.md; `python -m docs._generate`
writes them from bench/results.json."""

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from bench.report.store import Results, figure
from bench.report.tables import Cell, number, slashed, table

RESULTS: Final = Path(__file__).parent.parent / "results.json"
# In README.md: the title of each peer, and the features that it has and this panel lacks.
README_PEERS: Final[Mapping[str, tuple[str, str]]] = {
    "kiosk": ("**this panel**", ""),
    "rosbridge-rs": (
        "rosbridge (Rust) + roslib page",
        "the ROS graph from JavaScript, services and actions on any RMW",
    ),
    "plain": ("plain FastAPI page, press by fetch", "nothing to learn"),
    "nicegui": ("NiceGUI + Zenoh", "pages written in Python"),
    "zenoh-ts": ("zenoh-ts + Rust router", "no server to write"),
}
NOT_MEASURED: Final[Mapping[str, str]] = {
    "Foxglove, Lichtblick": "3-D, street maps, plots of anything",
    "FUXA": "13 languages, PLC protocols",
    "hand-made Qt or Tauri screen": "full control of the design, no browser",
}
COMPARISON_PEERS: Final[Mapping[str, str]] = {
    "kiosk": "this panel",
    "plain": "plain FastAPI page, press by fetch",
    "plain-ws": "plain FastAPI page, press by WebSocket",
    "rosbridge-rs": "rosbridge-server-rs + roslib",
    "nicegui": "NiceGUI + Zenoh",
    "zenoh-ts": "zenoh-ts + remote-api (Rust router)",
}
RIVALS: Final = ("plain", "rosbridge-rs", "nicegui", "zenoh-ts")


def last_results() -> Results:
    results: Results = json.loads(RESULTS.read_text(encoding="utf-8"))
    return results


def readme_section(results: Results) -> str:
    """The table of README.md, and what it says in a sentence."""
    columns: Mapping[str, Cell] = {
        "robot → page": _cell(results, "down", "p50", ".2f"),
        "finger → robot": _cell(results, "up", "p50", ".2f"),
        "page": _cell(results, "start", "bytes", ".0f", " kB", 1000),
        "server CPU, memory": _joined(
            _cell(results, "cost", "server_1000", ".1f", " %"),
            _cell(results, "cost", "rest_mib", ".0f", " MiB"),
        ),
        "browser CPU": _cell(results, "cost", "browser_1000", ".0f", " %"),
    }
    lines = [["", *columns, "features that this panel lacks"]]
    for peer, (title, lacks) in README_PEERS.items():
        lines.append([title, *(cell(peer) for cell in columns.values()), lacks])
    lines += [[title, *["–"] * len(columns), lacks] for title, lacks in NOT_MEASURED.items()]
    down, up = (_ahead(results, phase) for phase in ("down", "up"))
    sentence = (
        f"Measured on {measured_on(results)}; CPU in % of one core with a topic at 1 kHz. The fastest "
        f"is {down} ms (robot → page) and {up} ms (finger → robot) faster, "
        "but writes no log and checks no permission before a press."
    )
    return f"{table(lines)}\n\n{sentence}"


def comparison_table(results: Results) -> str:
    """The table of docs/comparison.md."""
    columns: Mapping[str, Cell] = {
        "robot → page": _with_p99(results, "down"),
        "finger → robot": _with_p99(results, "up"),
        "page kB": _cell(results, "start", "bytes", ".0f", per=1000),
        "page shown ms": _cell(results, "start", "shown_ms", ".0f"),
        "server memory MiB": _cell(results, "cost", "rest_mib", ".0f"),
        "server CPU at 1 kHz": _cell(results, "cost", "server_1000", ".1f", " %"),
        "browser CPU at 1 kHz": _cell(results, "cost", "browser_1000", ".0f", " %"),
    }
    lines = [["", *columns]]
    lines += [
        [title, *(cell(peer) for cell in columns.values())] for peer, title in COMPARISON_PEERS.items()
    ]
    return f"Measured on {measured_on(results)}.\n\n{table(lines)}"


def measured_on(results: Results) -> str:
    """The day of the latencies, like "2026-11-25"."""
    return str(results["down"]["at"]).partition(" ")[0]


def _cell(
    results: Results, phase: str, name: str, shape: str, unit: str = "", per: float = 1.0
) -> Cell:
    def cell(peer: str) -> str:
        value = figure(results, phase, peer, name)
        return number(value / per, shape) + ("" if math.isnan(value) else unit)

    return cell


def _with_p99(results: Results, phase: str) -> Cell:
    p50, p99 = (_cell(results, phase, name, ".2f") for name in ("p50", "p99"))
    return lambda peer: slashed((p50(peer), p99(peer)))


def _joined(first: Cell, second: Cell) -> Cell:
    return lambda peer: f"{first(peer)}, {second(peer)}"


def _ahead(results: Results, phase: str) -> str:
    """By how many ms the fastest rival is faster than this panel."""
    rivals = [figure(results, phase, peer, "p50") for peer in RIVALS]
    best = min(value for value in rivals if not math.isnan(value))
    return number(figure(results, phase, "kiosk", "p50") - best, ".1f")

"""The results as Markdown: tables for docs/benchmark.md, and all tables in results.md."""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Final

from bench.light_rows import asked
from bench.report.figures import ratio
from bench.report.picture import picture
from bench.report.store import Results, figure
from bench.report.targets import FLOOR, FLOOR_AGAIN, Grown, grown, targets

BEGIN: Final = "<!-- bench -->"
END: Final = "<!-- /bench -->"
NONE: Final = "–"
PICTURE: Final = "![Latency of this panel, the floor and its rivals](../bench/results.svg)"

Titles = Mapping[str, str]
Cell = Callable[[str], str]


def write(results: Results, titles: Titles, folder: Path, page: Path | None) -> None:
    """Writes results.md and results.svg to a folder, and the section of a page, if given."""
    (folder / "results.svg").write_text(picture(results, titles))
    (folder / "results.md").write_text(whole(results, titles))
    if page is not None:
        before, begin, rest = page.read_text().partition(BEGIN)
        _, end, after = rest.partition(END)
        if not begin or not end:
            raise ValueError(f"{page} has no section between {BEGIN} and {END}")
        page.write_text(f"{before}{BEGIN}\n{section(results, titles)}\n{END}{after}")


def section(results: Results, titles: Titles) -> str:
    """The section of docs/benchmark.md."""
    parts = [PICTURE, main_table(results, titles), targets_table(results), faults(results, titles)]
    return "\n\n".join(filter(None, [machine(results), *parts]))


def whole(results: Results, titles: Titles) -> str:
    parts = {
        "Latency and cost": main_table(results, titles),
        "To reach": targets_table(results),
        "Load": load_table(results, titles),
        "Many clients": crowd_table(results, titles),
        "A browser that stands still": stalled_table(results, titles),
        "Start": start_table(results, titles),
        "Growth of this panel": growth_table(results),
        "Both dialects": dialects_table(results, titles),
        "A flood of alarms on this panel": flood_table(results),
        "Beside the floors of its libraries": light_table(results),
        "Not measured": faults(results, titles),
    }
    sections = [f"## {title}\n\n{part}" for title, part in parts.items() if part]
    return "\n\n".join(["# Results", machine(results), noise(results), *sections]) + "\n"


def machine(results: Results) -> str:
    on, sizes = results.get("machine"), results.get("sizes", {})
    if not on:
        return ""
    quick = "**A quick run: it shows that the harness works, and no more.** " if sizes["quick"] else ""
    return (
        f"{quick}{on['cores']} cores ({on['processor']}), {on['system']}, Python {on['python']}, "
        f"Chromium {on['chromium']}; {sizes['rounds']} interleaved rounds, medians over them. "
        f"p50 / p99 in ms, processor in % of one core; {NONE}: not there, or not measured."
    )


def noise(results: Results) -> str:
    """The sentence about the noise: the floor compared with itself."""

    def down(peer: str, name: str) -> float:
        return figure(results, "down", peer, name)

    both = [ratio(down(FLOOR_AGAIN, name), down(FLOOR, name)) for name in ("p50", "p99")]
    if math.isnan(sum(both)):
        return ""
    before = results["machine"]["load_before"]
    return (
        f"The floor measured twice in each round differs from itself by {both[0]:.2f} × (p50) and "
        f"{both[1]:.2f} × (p99); the machine's load was {before} when the run began. Chromium's "
        f"word for its pages' clocks is as round trips tell, within {_doubt(results):.2f} ms."
    )


def _doubt(results: Results) -> float:
    rounds = results.get("down", {}).get("rounds", [])
    return max(
        (figures["doubt_ms"] for peers in rounds for figures in peers.values()), default=math.nan
    )


def main_table(results: Results, titles: Titles) -> str:
    def cell_of(phase: str, name: str, shape: str = ".2f", per: float = 1.0) -> Cell:
        return lambda peer: number(figure(results, phase, peer, name) / per, shape)

    def several(*cells: Cell) -> Cell:
        return lambda peer: slashed(cell(peer) for cell in cells)

    columns: Mapping[str, Cell] = {
        "put → DOM": several(cell_of("down", "p50"), cell_of("down", "p99")),
        "ROS put → bridge → DOM": several(cell_of("bridge", "p50"), cell_of("bridge", "p99")),
        "released → robot": several(cell_of("up", "p50"), cell_of("up", "p99")),
        "start s": cell_of("start", "answers_s"),
        "page kB": cell_of("start", "bytes", ".0f", 1000),
        "page shown ms": cell_of("start", "shown_ms", ".0f"),
        "memory MiB": cell_of("cost", "rest_mib", ".0f"),
        "server idle / 100 Hz / 1 kHz": several(
            *(cell_of("cost", f"server_{hz}", ".1f") for hz in (0, 100, 1000))
        ),
        "server 100 × 50 Hz": cell_of("cost", "server_wide", ".0f"),
        "browser 1 kHz": cell_of("cost", "browser_1000", ".0f"),
    }
    return peers_table(columns, titles)


def load_table(results: Results, titles: Titles) -> str:
    def cell_of(load: str) -> Cell:
        names = {"server": ".1f", "browser": ".1f", "rss": ".0f"}
        return lambda peer: slashed(
            number(figure(results, "cost", peer, f"{name}_{load}"), shape)
            for name, shape in names.items()
        )

    loads = {"idle": "0", "100 Hz": "100", "1 kHz": "1000", "100 topics × 50 Hz": "wide"}
    table = peers_table({title: cell_of(load) for title, load in loads.items()}, titles)
    return table and f"Server CPU % / browser CPU % / server MiB\n\n{table}"


def crowd_table(results: Results, titles: Titles) -> str:
    counts = results.get("sizes", {}).get("crowds", [])

    def at(count: int) -> Cell:
        def cell(peer: str) -> str:
            names = {"p50": ".1f", "p99": ".1f", "crowd": ".0f", "mib": ".0f", "came": ".0%"}
            return slashed(
                number(figure(results, "cost", peer, f"{name}_{count}"), shape)
                for name, shape in names.items()
            )

        return cell

    table = peers_table({f"{count}": at(count) for count in counts}, titles)
    return table and f"Clients at 10 Hz: p50 / p99 ms / server CPU % / server MiB / came\n\n{table}"


def stalled_table(results: Results, titles: Titles) -> str:
    def cell_of(name: str, shape: str) -> Cell:
        return lambda peer: number(figure(results, "stalled", peer, name), shape)

    columns = {
        "server grows, MiB": cell_of("grown_mib", ".1f"),
        "others before, p50": cell_of("before_p50", ".1f"),
        "p99": cell_of("before_p99", ".1f"),
        "during the stall, p50": cell_of("during_p50", ".1f"),
        "p99 then": cell_of("during_p99", ".1f"),
        "age of the first value shown after, ms": cell_of("first_ms", ".0f"),
        "old values shown": cell_of("old", ".0f"),
    }
    return peers_table(columns, titles)


def start_table(results: Results, titles: Titles) -> str:
    def cell_of(name: str, shape: str) -> Cell:
        return lambda peer: number(figure(results, "start", peer, name), shape)

    columns = {
        "process → HTTP 200, s": cell_of("answers_s", ".2f"),
        "→ commands reach the robot, s": cell_of("ready_s", ".2f"),
        "the first time, s": cell_of("first_ready_s", ".2f"),
        "page's answer, ms": cell_of("html_ms", ".1f"),
        "request → state shown, ms": cell_of("shown_ms", ".0f"),
        "bytes": cell_of("bytes", ",.0f"),
    }
    return peers_table(columns, titles)


def growth_table(results: Results) -> str:
    rows = [
        [
            growth.axis.text,
            ", ".join(f"{x:g}" for x in growth.xs),
            ", ".join(f"{y:.1f}" for y in growth.cpu),
            f"{growth.cpu_slope.per_unit * growth.axis.per:.3g} per {growth.axis.unit}",
            ", ".join(f"{y:.0f}" for y in growth.mib),
            f"{growth.mib_slope.per_unit * growth.axis.per * 1024:.3g} KiB per {growth.axis.unit}",
            _linear(growth),
        ]
        for growth in grown(results)
    ]
    head = ["what grows", "at", "server CPU %", "slope", "MiB", "slope", "linear or better"]
    return table([head, *rows]) if rows else ""


def flood_table(results: Results) -> str:
    """What presses take beside each kind of flood."""
    rounds = results.get("flood", {}).get("rounds") or [{}]
    rows = [
        [
            name,
            f"{figures['presses']:g}",
            f"{figures['p50']:.1f}",
            f"{figures['longest']:.0f}",
            f"{figures['cpu_percent']:.0f}",
            f"{figures['rss_mib']:.0f}",
        ]
        for name, figures in rounds[0].items()
    ]
    head = ["10,000 alarms, and", "presses", "p50 in ms", "longest in ms", "server CPU %", "MiB"]
    return table([head, *rows]) if rows else ""


def light_table(results: Results) -> str:
    """What this panel takes beside the floors of `bench/light.py`, and what is asked of it."""
    rounds = results.get("light", {}).get("rounds") or [{}]
    rows = [
        [
            name,
            f"{figures['panel']:.3g} {figures['unit']}",
            f"{figures['floor']:.3g} {figures['unit']}",
            f"{figures['ratio']:.2f} ×",
            asked(figures),
        ]
        for name, figures in rounds[0].items()
    ]
    return table([["", "this panel", "floor", "ratio", "asked"], *rows]) if rows else ""


def dialects_table(results: Results, titles: Titles) -> str:
    """This panel over the bridge and on rmw_zenoh, from node to page and back."""

    def cell_of(*names: str, shape: str = ".2f") -> Cell:
        return lambda peer: slashed(
            number(figure(results, "dialects", peer, name), shape) for name in names
        )

    columns = {
        "node → DOM": cell_of("down_p50", "down_p99"),
        "released → node": cell_of("up_p50", "up_p99"),
        "server idle / 100 Hz / 1 kHz": cell_of(
            *(f"server_{hz}" for hz in (0, 100, 1000)), shape=".1f"
        ),
        "memory MiB": cell_of("rest_mib", shape=".0f"),
    }
    return peers_table(columns, titles)


def _linear(growth: Grown) -> str:
    worse = [
        noun
        for noun, slope in (("CPU", growth.cpu_slope), ("memory", growth.mib_slope))
        if not slope.linear
    ]
    return f"no: {', '.join(worse)}" if worse else "yes"


def targets_table(results: Results) -> str:
    words = {True: "yes", False: "**no**", None: NONE}
    rows = [[target.text, target.measured, words[target.reached]] for target in targets(results)]
    return table([["target", "measured", "reached"], *rows])


def faults(results: Results, titles: Titles) -> str:
    lines = [f"- {titles.get(where, where)}: {error}" for where, error in results["faults"].items()]
    return "\n".join(lines)


def peers_table(columns: Mapping[str, Cell], titles: Titles) -> str:
    """A table of the peers with at least one figure."""
    rows = [[title, *(cell(peer) for cell in columns.values())] for peer, title in titles.items()]
    known = [row for row in rows if any(cell.strip(f"{NONE} /") for cell in row[1:])]
    return table([["", *columns], *known]) if known else ""


def table(lines: Sequence[Sequence[str]]) -> str:
    head, *rows = lines
    return "\n".join(f"| {' | '.join(line)} |" for line in (head, ["---"] * len(head), *rows))


def slashed(cells: Iterable[str]) -> str:
    """Several figures in a cell; one dash if there is none."""
    shown = list(cells)
    return " / ".join(shown) if set(shown) != {NONE} else NONE


def number(value: float, shape: str) -> str:
    return NONE if math.isnan(value) else format(value, shape)

"""A picture of the latencies: a bar to each peer's p50, and a line from there to its p99."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from html import escape
from typing import Final

from bench.report.store import Results, figure

WIDTH: Final = 860
LEFT: Final = 250  # width of the titles
RIGHT: Final = 110  # width of the figures
ROW: Final = 26
BAR: Final = 14
HEAD: Final = 46
GAP: Final = 18
PANELS: Final = {
    "down": "Down: the robot's put → the page's DOM has changed (ms; bar: p50, line: to p99)",
    "bridge": "Down from rclpy, over the real bridge (ms)",
    "up": "Up: pointer released → the robot's callback (ms)",
}
SHOWN_AT_MOST: Final = 4.0  # times the largest p50; a longer p99 is cut off


@dataclass(frozen=True)
class Row:
    title: str
    ours: bool
    p50: float
    p99: float


def picture(results: Results, titles: Mapping[str, str]) -> str:
    """An SVG, readable on light and dark pages."""
    parts: list[str] = []
    y = 0
    for phase, title in PANELS.items():
        rows = _rows(results, phase, titles)
        if rows:
            parts.append(_panel(title, rows, y))
            y += HEAD + ROW * len(rows) + GAP
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {max(y, 1)}" width="{WIDTH}" '
        f'height="{max(y, 1)}" font-family="system-ui, sans-serif" font-size="13">\n'
        f'<rect width="{WIDTH}" height="{max(y, 1)}" fill="#fff"/>\n' + "\n".join(parts) + "\n</svg>\n"
    )


def _rows(results: Results, phase: str, titles: Mapping[str, str]) -> list[Row]:
    rows = [
        Row(title, peer == "kiosk", *(figure(results, phase, peer, p) for p in ("p50", "p99")))
        for peer, title in titles.items()
    ]
    return sorted((row for row in rows if not math.isnan(row.p50)), key=lambda row: row.p50)


def _panel(title: str, rows: list[Row], top: int) -> str:
    widest = min(max(row.p99 for row in rows), SHOWN_AT_MOST * max(row.p50 for row in rows))
    per_ms = (WIDTH - LEFT - RIGHT) / widest
    lines = [f'<text x="12" y="{top + 28}" font-weight="bold" fill="#222">{escape(title)}</text>']
    for turn, row in enumerate(rows):
        y = top + HEAD + turn * ROW
        end = LEFT + min(row.p99, widest) * per_ms
        middle = y + BAR / 2
        weight = ' font-weight="bold"' if row.ours else ""
        lines += [
            f'<text x="{LEFT - 10}" y="{y + 11}" text-anchor="end" fill="#222"{weight}>'
            f"{escape(row.title)}</text>",
            f'<rect x="{LEFT}" y="{y}" width="{row.p50 * per_ms:.1f}" height="{BAR}" '
            f'fill="{"#0b5cad" if row.ours else "#9aa5b1"}"/>',
            f'<path d="M{LEFT + row.p50 * per_ms:.1f} {middle}H{end:.1f}m0-4v8" fill="none" '
            'stroke="#555"/>',
            f'<text x="{end + 6:.1f}" y="{y + 11}" fill="#222"{weight}>'
            f"{row.p50:.2f} / {row.p99:.1f}</text>",
        ]
    return "\n".join(lines)

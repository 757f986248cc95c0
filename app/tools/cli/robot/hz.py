"""`operator-panel hz TOPIC`: how often a topic is published, as `ros2 topic hz` shows it.

Exit status: 0 it was ended; 1 no robot, no such topic, or no message; 2 a mistake on the command
line.
"""

import asyncio
import math
import sys
import time
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from itertools import pairwise
from statistics import fmean, pstdev
from typing import Any, Final

from app.tools.cli.arguments import seconds, whole_number
from app.tools.cli.parser import Parser
from app.tools.cli.robot.options import GONE, add_options, ended, place_of
from app.tools.robot.link import opened
from app.tools.robot.topic_reader import TopicReader

PROG = "python -m app.cli hz"
EVERY_S: Final = 1.0
WINDOW: Final = 10_000  # messages, as that of ros2


class Rate:
    """When the newest messages arrived (monotonic seconds), `window` of them."""

    def __init__(self, window: int = WINDOW) -> None:
        self.arrivals = deque[float](maxlen=window)

    def __str__(self) -> str:
        """Two lines, as `ros2 topic hz` writes them; "" for less than two messages."""
        gaps = [later - sooner for sooner, later in pairwise(self.arrivals)]
        if not gaps:
            return ""
        mean = fmean(gaps)
        rate = 1 / mean if mean else math.inf
        return (
            f"average rate: {rate:.3f}\n\tmin: {min(gaps):.3f}s max: {max(gaps):.3f}s"
            f" std dev: {pstdev(gaps):.5f}s window: {len(self.arrivals)}"
        )


def main(arguments: Sequence[str], prog: str = PROG) -> int:
    options = make_parser(prog).parse_args(arguments)
    return ended(lambda: _measure(options))


async def _measure(options: Any) -> int:
    place = place_of(options)
    rate = Rate(options.window)
    async with opened(place) as (observer, graph):
        reader = await TopicReader.find(observer, graph, place, options.topic)
        showing = asyncio.create_task(_show(rate))
        try:
            with suppress(TimeoutError):
                async with asyncio.timeout(options.duration):
                    async for sample in reader.samples():
                        if not sample.cached:  # published at an unknown time
                            rate.arrivals.append(sample.at)
        finally:
            showing.cancel()
    if options.duration is None:
        return 0
    print(
        str(rate) or f"no rate: {len(rate.arrivals)} message(s) in {options.duration:g} s", flush=True
    )
    return 0 if str(rate) else GONE


async def _show(rate: Rate) -> None:
    """Each second what is new; a topic that falls silent is reported once."""
    last, silent = 0.0, False
    while True:
        await asyncio.sleep(EVERY_S)
        newest = rate.arrivals[-1] if rate.arrivals else 0.0
        if newest != last and str(rate):
            print(rate, flush=True)
            silent = False
        elif newest == last and not silent:
            since = f" for {time.monotonic() - newest:.1f} s" if newest else " yet"
            print(f"no new messages{since}", file=sys.stderr, flush=True)
            silent = True
        last = newest


def make_parser(prog: str) -> Parser:
    parser = Parser(
        prog=prog,
        description="Shows how often a topic is published, once a second, by when its messages arrive"
        " here: through the robot's bridge, and without ROS.",
        epilog="Ctrl-C ends it. Exit status: 1 no robot, no such topic, or with --for no rate.",
    )
    add = parser.add_argument
    add("topic", metavar="TOPIC", help="such as /speed")
    add(
        "-w",
        "--window",
        type=whole_number(2),
        default=WINDOW,
        metavar="N",
        help="of how many messages; default: %(default)s",
    )
    add(
        "--for",
        dest="duration",
        type=seconds(),
        metavar="S",
        help="end after so many seconds, with the rate of them",
    )
    add_options(parser)
    return parser

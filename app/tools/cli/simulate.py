"""`operator-panel simulate [PANEL] [ENDPOINT [NAMESPACE]]`: the demo robot alone, or a recording.

Exit status: 0 it was ended, or the recording is over, 1 it can't listen there, 2 a mistake on the
command line, a panel with faults, or a recording that can't be read.
"""

import math
import signal
import sys
import threading
from argparse import ArgumentTypeError
from collections.abc import Iterable, Mapping, Sequence
from contextlib import ExitStack, closing
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

from app.panel import load_panel
from app.panel.model import Panel
from app.ros.dialects.dialect import DialectName
from app.ros.messages import load_interfaces
from app.ros.messages.names import NAMESPACE
from app.system.errors import KioskError, LinkError
from app.system.settings import Settings
from app.tools.cli.arguments import ros_domain
from app.tools.cli.parser import Parser
from app.tools.simulator.in_process import robots_of
from app.tools.simulator.zenoh import ENDPOINT, Way, serve, way_of

if TYPE_CHECKING:
    from app.tools.simulator.robot import SimulatedRobot

PROG = "python -m app.simulator"
SUFFIX = ".toml"

report = partial(print, file=sys.stderr, flush=True)


def main(arguments: Sequence[str], prog: str = PROG) -> int:
    parser = make_parser(prog)
    options = _sorted_out(parser, parser.parse_args(arguments))
    namespace = options.namespace.rstrip("/")
    if not NAMESPACE.fullmatch(namespace):
        report(f'demo robot: "{namespace}" is not a ROS 2 namespace, like /robot1')
        return 2
    ends = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: ends.set())
    try:
        panel = load_panel(options.panel or Settings.from_environment().panel)
        interfaces = load_interfaces(panel.distro, panel.interfaces)
        listening = partial(report, f"demo robot: listening at {options.endpoint}")
        with ExitStack() as stack:
            robots = _simulated(panel, namespace)
            if options.bag is not None:
                robots = {namespace: _replayed(options, panel, ends, stack)}
            ways = _ways(options, panel, robots)
            serve(options.endpoint, robots, interfaces, ends, listening, ways)
    except KioskError as error:
        report(f"demo robot: {error}")
        return 1 if isinstance(error, LinkError) else 2
    return 0


def _ways(options: Any, panel: Panel, namespaces: Iterable[str]) -> dict[str, Way]:
    """How each robot is reached: by the command line, else as the panel file says."""
    entries = {robot.namespace: robot for robot in panel.robots}
    first = next(iter(panel.robots), panel)
    return {
        name: way_of(panel, entries.get(name, first), options.dialect, options.domain)
        for name in namespaces
    }


def _simulated(panel: Panel, namespace: str) -> "Mapping[str, SimulatedRobot]":
    """The robots of the panel; with a namespace the first of them, in it."""
    robots = robots_of(panel)
    return {namespace: next(iter(robots.values()))} if namespace else robots


def _replayed(options: Any, panel: Panel, ends: threading.Event, stack: ExitStack) -> "SimulatedRobot":
    """A recording. If a panel file was given, prints what the recording lacks for it."""
    from app.tools.simulator.bag import Recording, ReplayedRobot, missing

    recording = stack.enter_context(closing(Recording(options.bag)))
    robot = ReplayedRobot(recording, options.rate, options.loop, ends.set)
    lacks = missing(panel, recording.topics) if options.panel else ()
    for note in (*recording.notes, *lacks):
        report(f"demo robot: {note}")
    about = f"{len(recording.topics)} topic(s), {recording.duration_s:.1f} s"
    report(f"demo robot: replaying {options.bag}: {about}")
    return robot


def _sorted_out(parser: Parser, options: Any) -> Any:
    """The arguments with what is no panel file moved to where it belongs."""
    words = [word for word in (options.panel, options.endpoint, options.namespace) if word is not None]
    panel = words.pop(0) if words and words[0].endswith(SUFFIX) else None
    if len(words) > 2:
        parser.error(f'"{words[2]}" is one argument too many')
    if options.bag is None and (options.loop or options.rate is not None):
        parser.error("--loop and --rate are of a recording: give --bag too")
    options.panel = None if panel is None else Path(panel)
    options.endpoint = words[0] if words else ENDPOINT
    options.namespace = words[1] if len(words) > 1 else ""
    options.rate = 1.0 if options.rate is None else options.rate
    return options


def _rate(text: str) -> float:
    try:
        rate = float(text)
    except ValueError:
        rate = math.nan
    if not 0 < rate <= 1000:
        raise ArgumentTypeError(f'"{text}" is not a rate: more than 0, 1000 at most, like 2 or 0.5')
    return rate


def make_parser(prog: str) -> Parser:
    parser = Parser(
        prog=prog,
        usage=f"{prog} [-h] [--dialect NAME] [--domain N] [--bag FILE [--loop] [--rate RATE]]"
        " [PANEL] [ENDPOINT [NAMESPACE]]",
        description="The demo robot as a Zenoh peer of its own, for panels to connect to: it has what a"
        " panel shows, publishes, calls and sets, or publishes what was recorded.",
    )
    parser.add_argument(
        "panel",
        nargs="?",
        metavar="PANEL",
        help="its panel file, *.toml; default: that of KIOSK_PANEL, else the shipped one",
    )
    parser.add_argument(
        "endpoint",
        nargs="?",
        metavar="ENDPOINT",
        help=f"where it listens, as Zenoh names it; default: {ENDPOINT}",
    )
    parser.add_argument(
        "namespace",
        nargs="?",
        metavar="NAMESPACE",
        help="of its topics, such as /robot1; default: what the panel file says",
    )
    parser.add_argument(
        "--bag",
        type=Path,
        metavar="FILE",
        help="replay this recording: an .mcap or .db3 file, or a folder of rosbag2",
    )
    parser.add_argument(
        "--dialect",
        choices=get_args(DialectName),
        help="bridge: behind a bridge of its own; rmw_zenoh: as nodes on rmw_zenoh; default: as the"
        " panel file says",
    )
    parser.add_argument(
        "--domain", type=ros_domain, metavar="N", help="the nodes' ROS_DOMAIN_ID on rmw_zenoh"
    )
    parser.add_argument("--loop", action="store_true", help="replay it again and again")
    parser.add_argument(
        "--rate", type=_rate, metavar="RATE", help="how many times as fast as recorded; default: 1"
    )
    return parser

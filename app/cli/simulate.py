"""`operator-panel simulate [ENDPOINT [NAMESPACE]]`: the demo robot alone.

Exit status: 0 it was ended, 1 it can't listen there, 2 a mistake on the command line.
"""

import signal
import sys
import threading
from collections.abc import Sequence
from functools import partial

from app.cli.parser import Parser
from app.errors import LinkError
from app.interfaces.names import NAMESPACE
from app.simulator.zenoh_peer import ENDPOINT, serve

PROG = "python -m app.simulator"


def main(arguments: Sequence[str], prog: str = PROG) -> int:
    given = _parser(prog).parse_args(arguments)
    endpoint, namespace = given.endpoint, given.namespace.rstrip("/")
    say = partial(print, file=sys.stderr, flush=True)
    if not NAMESPACE.fullmatch(namespace):
        say(f'demo robot: "{namespace}" is not a ROS 2 namespace, like /robot1')
        return 2
    ends = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: ends.set())
    try:
        serve(endpoint, namespace, ends, lambda: say(f"demo robot: listening at {endpoint}"))
    except LinkError as error:
        say(f"demo robot: {error}")
        return 1
    return 0


def _parser(prog: str) -> Parser:
    parser = Parser(
        prog=prog,
        description="The demo robot as a Zenoh peer of its own, for panels to connect to.",
    )
    parser.add_argument(
        "endpoint",
        nargs="?",
        default=ENDPOINT,
        metavar="ENDPOINT",
        help="where it listens, as Zenoh names it; default: %(default)s",
    )
    parser.add_argument(
        "namespace", nargs="?", default="", metavar="NAMESPACE", help="of its topics, such as /robot1"
    )
    return parser

"""`operator-panel scaffold [-o FILE]`: a first panel that fits the robot behind a bridge.

Exit status: 0 it is written, 1 there is no robot, the file exists, or the bridge has lost topics or
services (the file is written without them), 2 a mistake on the command line.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final

from app.system.settings import APP
from app.tools.cli.arguments import seconds
from app.tools.cli.output import add_force, check_absent, draft_of
from app.tools.cli.parser import Parser
from app.tools.cli.robot.options import add_options, ended, namespace, place_of, report_lost
from app.tools.robot.scaffold import LISTEN_S, scaffold
from app.tools.scaffold.parts import Draft
from app.tools.scaffold.toml_text import proposal

PROG = "python -m app.cli scaffold"
MIN_ROBOTS: Final = 2
STDOUT: Final = "-"


def main(arguments: Sequence[str], prog: str = PROG) -> int:
    parser = make_parser(prog)
    options = parser.parse_args(arguments)
    if options.robot and (options.namespace or len({*options.robot}) < MIN_ROBOTS):
        parser.error("--robot is given for each of several robots, and without --namespace")
    return ended(lambda: _scaffold(options))


async def _scaffold(options: Any) -> int:
    target = None if options.output == STDOUT else Path(options.output)
    if target is not None:
        check_absent(target, options.force)
    made = await scaffold(
        place_of(options),
        Path() if target is None else target.resolve().parent,
        namespaces=options.robot or (),
        controls=options.controls,
        listen_s=options.listen,
    )
    if target is None:
        print(made.text, end="", flush=True)
    else:
        _write(target, made.text, options.force)
        print(*_summary(target, made.draft, options.controls), sep="\n", flush=True)
    return report_lost(made.lost)


def _write(target: Path, text: str, force: bool) -> None:
    with draft_of(target, force) as draft:
        draft.write_text(text, encoding="utf-8")


def _summary(target: Path, draft: Draft, live: bool) -> Iterator[str]:
    """What was written, and what to do next. `live`: the controls are not commented out."""
    widgets = [widget for page in draft.pages.values() for widget in page]
    acting = sum(widget.control for widget in widgets)
    yield (
        f"{target}: {len(draft.pages)} page(s), {len(widgets) - acting} display(s),"
        f" {acting} control(s), {len(draft.interlocks)} interlock candidate(s)"
    )
    if live and (alone := sum(widget.control and not widget.interlock for widget in widgets)):
        yield f"{alone} of the controls are commented out: no candidate is of their namespace."
    if acting and not live:
        yield "The controls are commented out: uncomment those that you want, each with its interlock."
    if draft.alike:
        yield proposal(draft.alike)
    yield f"Start it: {APP} run {target}"


def make_parser(prog: str) -> Parser:
    parser = Parser(
        prog=prog,
        description="Writes a first panel file that fits what is on a robot now: lamps, gauges, joints,"
        " cameras, tables, trends, the log; controls commented out.",
        epilog="It only reads from the robot. Exit status: 1 there is no robot, the file exists, or the"
        " bridge has lost topics or services of a node: the file is written without them.",
    )
    add = parser.add_argument
    add(
        "-o",
        "--output",
        default="cell.toml",
        metavar="FILE",
        help='the panel file; default: %(default)s; "-" prints it',
    )
    add_force(parser)
    add(
        "--controls",
        action="store_true",
        help="live controls, each behind the interlock candidate of its namespace: look at each first",
    )
    add(
        "--listen",
        type=seconds(),
        default=LISTEN_S,
        metavar="S",
        help="seconds to wait for messages, for names of joints and for ranges; default: %(default)g",
    )
    add(
        "--robot",
        action="append",
        type=namespace,
        metavar="NAMESPACE",
        help="the namespace of one of several robots, such as /left; given for each of them",
    )
    add_options(parser)
    return parser

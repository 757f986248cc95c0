"""`operator-panel scaffold [-o FILE]`: a first panel that fits the robot behind a bridge.

Exit status: 0 it is written, 1 there is no robot, the file exists, or the bridge has lost topics or
services (the file is written without them), 2 a mistake on the command line.
"""

import os
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Final

from app.cli.arguments import seconds
from app.cli.output import add_force, check_absent, draft_of
from app.cli.parser import Parser
from app.cli.robot.link import (
    Place,
    add_options,
    check_namespace,
    ended,
    namespace,
    nothing_there,
    opened,
    place_of,
    report_lost,
)
from app.cli.robot.scaffold_input import fullest_of, read_scaffold_input, usable
from app.cli.robot.settled_graph import settled_graph
from app.diagnose.findings import few
from app.errors import KioskError
from app.interfaces import load_interfaces
from app.panel.load import faults_of_text
from app.scaffold.checked import LeftOut, checked_draft
from app.scaffold.draft import lost_names, make_draft
from app.scaffold.draft_parts import Draft
from app.scaffold.labels import own_labels
from app.scaffold.naming import label_of
from app.scaffold.robots import alike_namespaces, proposal
from app.scaffold.toml_text import toml_text
from app.settings import APP
from app.survey.model import GraphSnapshot

PROG = "python -m app.cli scaffold"
LISTEN_S: Final = 3.0
MIN_ROBOTS: Final = 2
SEVERAL: Final = "Robots"
STDOUT: Final = "-"


class ScaffoldError(KioskError):
    """A panel that can't be made."""


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
    place = place_of(options)
    interfaces = load_interfaces(place.distro, place.interfaces)
    async with opened(place) as (observer, graph):
        graph = await settled_graph(observer, graph, place)
        for chosen in options.robot or (place.namespace,):
            check_namespace(graph, chosen)
        graph = usable(graph)
        if not graph.robots:
            raise ScaffoldError("no bridge has a namespace of ROS 2: correct `namespace` in its file")
        robot, below = fullest_of(graph, options.robot or (place.namespace,))
        known = await read_scaffold_input(observer, robot, below, interfaces, options.listen)
    if not any((known.topics, known.services, known.actions, known.parameters)):
        raise ScaffoldError(nothing_there([robot], f"{robot.namespace}{below}"))
    base = _base(place, graph, f"{robot.namespace}{below}", target, options.robot or ())
    draft = _checked(partial(make_draft, known, interfaces, base, options.controls), target)
    if options.controls and not draft.interlocks:
        raise ScaffoldError(
            "no topic looks like a permission of the robot, so no control is made live: leave"
            " --controls out, and give the controls an interlock of your own"
        )
    text = toml_text(draft, options.controls)
    if target is None:
        print(text, end="", flush=True)
    else:
        _write(target, text, options.force)
        print(*_summary(target, draft, options.controls), sep="\n", flush=True)
    return report_lost(lost_names(known))


def _checked(make: Callable[[LeftOut], Draft], target: Path | None) -> Draft:
    """The draft without what a panel file can't have; ScaffoldError if it has other faults."""
    draft, faults = checked_draft(make, partial(faults_of_text, folder=_folder(target)))
    if faults:
        raise ScaffoldError(f"no panel can be made of this: {few([str(fault) for fault in faults])}")
    return draft


def _folder(target: Path | None) -> Path:
    return Path() if target is None else target.resolve().parent


def _base(
    place: Place, graph: GraphSnapshot, below: str, target: Path | None, chosen: Sequence[str] = ()
) -> Draft:
    """All but the pages. Several robots, and a place that is not that of zenoh.json5, are entries.
    `below` is the namespace of the pages; `chosen` are those of the robots, where the command line has
    them."""
    others = [robot.namespace for robot in graph.robots if robot.topics] if not place.namespace else []
    others = [*chosen] or others
    names = others if len(others) > 1 else [below]
    robots = []
    ids = [f"robot{number}" for number in range(1, len(names) + 1)] if len(names) > 1 else ["robot"]
    labels = own_labels(
        [(label_of(name or own_id), name) for name, own_id in zip(names, ids, strict=True)]
    )
    for name, own_id, label in zip(names, ids, labels, strict=True):
        entry: dict[str, Any] = {"id": own_id, "name": label}
        entry |= {"namespace": name} if name else {}
        entry |= place.reached
        robots.append(entry | ({"connect": list(place.connect)} if place.connect else {}))
    folder = _folder(target)
    return Draft(
        title=SEVERAL if len(names) > 1 else label_of(below or "Robot"),
        namespace=below,
        reached=place.reached,
        robots=robots if len(names) > 1 or place.connect else (),
        distro=place.distro,
        interfaces=[os.path.relpath(interface, folder) for interface in place.interfaces],
        alike=() if len(names) > 1 or place.namespace else alike_namespaces(graph.robots[0]),
    )


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

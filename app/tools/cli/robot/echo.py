"""`operator-panel echo TOPIC [TYPE]`: the messages of a topic, as `ros2 topic echo` shows them.

Exit status: 0 it was ended, or has shown one message with --once; 1 no robot, no such topic, or no
message in time; 2 a mistake on the command line.
"""

import asyncio
import json
import sys
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from app.cell.view.messages import Shape, csv_line, yaml_text
from app.ros.messages import Interfaces, to_plain
from app.system.errors import DecodeError
from app.system.printable import printable
from app.tools.cli.arguments import seconds, whole_number
from app.tools.cli.parser import Parser
from app.tools.cli.robot.options import GONE, add_options, ended, place_of
from app.tools.robot.link import opened
from app.tools.robot.topic_reader import TopicReader, value_in

PROG = "python -m app.cli echo"
SEPARATOR = "---"


def main(arguments: Sequence[str], prog: str = PROG) -> int:
    options = make_parser(prog).parse_args(arguments)
    return ended(lambda: _echo(options))


async def _echo(options: Any) -> int:
    place = place_of(options)
    async with opened(place) as (observer, graph):
        reader = await TopicReader.find(observer, graph, place, options.topic, options.type or "")
        interfaces = await reader.interfaces(place)
        if options.field:
            interfaces.type_at(reader.type, options.field)
        try:
            async with asyncio.timeout(options.timeout) as limit:
                async for sample in reader.samples():
                    limit.reschedule(None)
                    _show(bytes(sample.payload), interfaces, reader.type, options)
                    if options.once:
                        return 0
        except TimeoutError:
            print(f"no message on {reader.topic.name} in {options.timeout:g} s", file=sys.stderr)
            return GONE
    return 0


def _show(data: bytes, interfaces: Interfaces, type_name: str, options: Any) -> None:
    """One message. If it can't be decoded, the error is printed in its place."""
    try:
        value = value_in(data, interfaces, type_name, options.field or "")
    except DecodeError as error:
        print(error, file=sys.stderr, flush=True)
        return
    print(_written(options)(value), flush=True)


def _written(options: Any) -> Callable[[Any], str]:
    shape = Shape(
        most=None if options.full_length else options.truncate_length,
        lists=not options.no_arr,
        texts=not options.no_str,
    )
    if options.json:
        return lambda value: printable(json.dumps(to_plain(value), ensure_ascii=False))
    if options.csv:
        return partial(csv_line, shape=shape)
    return lambda value: f"{yaml_text(value, shape)}\n{SEPARATOR}"


def make_parser(prog: str) -> Parser:
    parser = Parser(
        prog=prog,
        description="Shows the messages of a topic, through the robot's bridge and without ROS.",
        epilog="Its type is that on the robot, and its QoS the publisher's. Ctrl-C ends it. Exit"
        " status: 1 no robot, no such topic, or no message in time.",
    )
    add = parser.add_argument
    add("topic", metavar="TOPIC", help="such as /speed")
    add("type", nargs="?", metavar="TYPE", help="only where it has several on the robot")
    add("--once", action="store_true", help="one message, then end")
    add("--timeout", type=seconds(), metavar="S", help="end if no message arrives in so many seconds")
    add("--field", metavar="PATH", help='only this field, such as pose.position.x or "status[0].name"')
    form = parser.add_mutually_exclusive_group().add_argument
    form("--csv", action="store_true", help="one line of values with commas for each message")
    form("--json", action="store_true", help="one line of JSON for each message")
    add("-f", "--full-length", action="store_true", help="lists and texts of any length")
    add(
        "-l",
        "--truncate-length",
        type=whole_number(1),
        default=128,
        metavar="N",
        help="so many elements of a list and characters of a text; default: %(default)s",
    )
    add("--no-arr", action="store_true", help="without the elements of lists")
    add("--no-str", action="store_true", help="without texts")
    add_options(parser)
    return parser

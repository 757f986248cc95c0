"""`operator-panel topics`: the topics of a robot through its bridge, as `ros2 topic list` shows them.

Exit status: 0 they are listed, 1 there is no robot or no topic, or the bridge has lost topics of it,
2 a mistake on the command line.
"""

import json
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from typing import Any, Final

from app.ros.graph.model import Forwarding, RobotGraph, SurveyedTopic, TopicEndpoint, topic_forwarding
from app.system.printable import one_line
from app.tools.cli.parser import Parser
from app.tools.cli.robot.options import GONE, add_options, ended, place_of, report_lost
from app.tools.robot.link import check_namespace, nothing_there, opened, settled_graph, shown_topics

PROG = "python -m app.cli topics"
NOT_FORWARDED: Final[Mapping[Forwarding, str]] = {
    "denied": "the bridge's `allow` or `deny` holds it back",
    "lost": "the bridge has lost it",
}
ListedTopics = Mapping[str, tuple[RobotGraph, SurveyedTopic]]


def main(arguments: Sequence[str], prog: str = PROG) -> int:
    options = make_parser(prog).parse_args(arguments)
    return ended(lambda: _list(options))


async def _list(options: Any) -> int:
    place = place_of(options)
    async with opened(place) as (observer, graph):
        graph = await settled_graph(observer, graph, place)
        check_namespace(graph, place.namespace)
        listed = {
            name: topic
            for name, topic in sorted(shown_topics(graph, place.namespace).items())
            if options.include_hidden_topics or not is_hidden(name)
        }
    if options.count_topics:
        print(len(listed))
    elif options.json:
        print(json.dumps([_plain(name, *topic) for name, topic in listed.items()], indent=1))
    else:
        for line in _lines(listed, options.show_types, options.verbose):
            print(one_line(line))
    if not listed:
        print(nothing_there(graph.robots, place.namespace), file=sys.stderr, flush=True)
        return GONE
    states = {name: topic_forwarding(*topic) for name, topic in listed.items()}
    return report_lost([name for name, state in states.items() if state == "lost"])


def is_hidden(name: str) -> bool:
    """As ROS 2 has it: a part of the name begins with "_"."""
    return "/_" in name


def _lines(listed: ListedTopics, types: bool, verbose: bool) -> Iterator[str]:
    for name, (robot, topic) in listed.items():
        yield f"{name} [{', '.join(topic.types)}]" if types or verbose else name
        if verbose:
            for word, endpoints in (("publisher", topic.publishers), ("subscriber", topic.subscribers)):
                yield from (f"  {word}: {_described(robot, endpoint)}" for endpoint in endpoints)
            if words := NOT_FORWARDED.get(topic_forwarding(robot, topic)):
                yield f"  not forwarded: {words}"


def _described(robot: RobotGraph, endpoint: TopicEndpoint) -> str:
    nodes = " or ".join(f"{robot.namespace}{node}" for node in endpoint.nodes) or "(node unknown)"
    return f"{nodes}, {endpoint.qos}" + (f", {endpoint.dds}" if endpoint.dds else "")


def _plain(name: str, robot: RobotGraph, topic: SurveyedTopic) -> dict[str, Any]:
    return {
        "name": name,
        "namespace": robot.namespace,
        "types": topic.types,
        "passed_on": topic.announced,
        "forwarding": topic_forwarding(robot, topic),
        "publishers": [asdict(publisher) for publisher in topic.publishers],
        "subscribers": [asdict(subscriber) for subscriber in topic.subscribers],
    }


def make_parser(prog: str) -> Parser:
    parser = Parser(
        prog=prog,
        description="Lists the topics of a robot, through its bridge and without ROS.",
        epilog="Exit status: 0 they are listed, 1 there is no robot or no topic, or its bridge has lost"
        " topics.",
    )
    add = parser.add_argument
    add("-t", "--show-types", action="store_true", help="with their types")
    add(
        "-v",
        "--verbose",
        action="store_true",
        help="with types, and each publisher and subscriber with its node and QoS",
    )
    add("-c", "--count-topics", action="store_true", help="only how many there are")
    add("--include-hidden-topics", action="store_true", help='those too whose name has a "/_"')
    add("--json", action="store_true", help="all that is known of them, as one JSON list")
    add_options(parser)
    return parser

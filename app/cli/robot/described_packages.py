"""The messages of packages as the robot's own nodes describe them, for who has no files of them."""

from collections import defaultdict
from collections.abc import Collection, Mapping

from app.cli.robot.link import Place, opened
from app.cli.robot.settled_graph import settled_graph
from app.errors import InterfaceError
from app.interfaces import load_interfaces
from app.interfaces.definitions import Structure
from app.survey.node_services import NodeServices

Files = Mapping[str, bytes]


async def described_packages(place: Place, names: Collection[str]) -> dict[str, Files]:
    """Package → files of the messages that the topics of the robot have, and of those in them. A node
    answers for its own topics (`get_type_description`); constants and defaults are not described.

    LinkError without a robot; InterfaceError if no node describes a message of one of the `names`.
    """
    known = load_interfaces(place.distro, place.interfaces)
    files: dict[str, dict[str, bytes]] = defaultdict(dict)
    async with opened(place) as (observer, graph):
        graph = await settled_graph(observer, graph, place)
        for robot in graph.robots:
            services = NodeServices(robot, known, observer)
            for topic in robot.topics:
                if topic.type.partition("/")[0] not in names:
                    continue
                described = await services.definitions(topic)
                for name, structure in described.structures.items() if described else ():
                    package, kind, rest = name.split("/")
                    if package in names or name not in known.structures:
                        files[package][f"{kind}/{rest}.{kind}"] = definition_text(structure).encode()
    if absent := [name for name in names if name not in files]:
        raise InterfaceError(
            f"no node describes a message of {absent[0]}: none has a topic with one, or its service"
            " get_type_description can't be called; copy the package from a folder or a wheel"
        )
    return dict(files)


def definition_text(structure: Structure) -> str:
    """A message's definition as a .msg file has it."""
    lines = [f"{str(field.type).replace('/msg/', '/')} {field.name}\n" for field in structure.fields]
    return "".join(lines)

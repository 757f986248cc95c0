"""`operator-panel interfaces add PACKAGE… --from SOURCE`: copies the definitions of ROS packages beside
a panel, so that it needs no workspace. `operator-panel interfaces list`: those that are built in.

Exit status: 0 done, 1 a package or a file is not there or can't be used, 2 a mistake on the command
line.
"""

import sys
from collections import Counter, defaultdict
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

from app.ros.graph.node_services import NodeServices
from app.ros.messages import DISTROS, load_interfaces
from app.ros.messages.definitions import Structure
from app.ros.messages.package_copy import Copied, copy_packages, opened_source, write_package
from app.system.errors import InterfaceError, KioskError
from app.tools.cli.parser import Parser
from app.tools.cli.robot.options import add_options, ended, place_of
from app.tools.robot.link import DEFAULT_DISTRO, Place, opened, settled_graph

# The messages of packages as the robot's own nodes describe them, for who has no files of them.

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


PROG: Final = "python -m app.cli interfaces"
FOLDER: Final = Path("interfaces")
WORDS: Final = {"msg": "message", "srv": "service", "action": "action"}
ROBOT: Final = "robot"  # in place of a source


def main(arguments: Sequence[str], prog: str = PROG) -> int:
    options = make_parser(prog).parse_args(arguments)
    try:
        return _list(options) if options.command == "list" else _add(options)
    except KioskError as error:
        print(error, file=sys.stderr)
    except OSError as error:
        print(f"{error.filename} can't be written: {error.strerror}", file=sys.stderr)
    return 1


def _add(options: Any) -> int:
    if str(options.source) == ROBOT:
        return ended(lambda: _add_from_robot(options))
    known = {
        name.partition("/")[0] for name in load_interfaces(options.distro or DEFAULT_DISTRO).structures
    }
    with opened_source(options.source) as source:
        copied = copy_packages(options.package, source, options.to, known)
    for package in copied.packages:
        why = f", which {package.needed_by} needs" if package.needed_by else ""
        state = "" if package.changed else " (as before)"
        print(f"{options.to / package.name}: {_counted(package.counts)}{why}{state}")
        if package.name in known:
            print(f"  {package.name} is built in too: the panel uses the copy")
    print(f'in the panel file: interfaces = ["{options.to}"]')
    return _report_missing(copied)


async def _add_from_robot(options: Any) -> int:
    packages = await described_packages(place_of(options), options.package)
    for name, files in packages.items():
        write_package(options.to / name, files)
        counts = Counter(path.partition("/")[0] for path in files)
        print(f"{options.to / name}: {_counted(counts)}, without constants and services")
    print(f'in the panel file: interfaces = ["{options.to}"]')
    return 0


def _report_missing(copied: Copied) -> int:
    for name, needed_by in copied.missing.items():
        print(
            f"{needed_by} needs {name}, which is neither built in nor in the source: add it from"
            " another",
            file=sys.stderr,
        )
    return 1 if copied.missing else 0


def _counted(counts: Any) -> str:
    parts = [
        f"{number} {WORDS[kind]}{'' if number == 1 else 's'}"
        for kind, number in counts.items()
        if number
    ]
    return ", ".join(parts) or "no definitions"


def _list(options: Any) -> int:
    """The built-in packages, or the types of one."""
    interfaces = load_interfaces(options.distro or DEFAULT_DISTRO)
    names = sorted(_type_names(interfaces.structures))
    if options.package:
        own = [name for name in names if name.startswith(f"{options.package}/")]
        if not own:
            raise InterfaceError(
                f"{options.package} is not built in: `operator-panel interfaces add` copies it"
            )
        print("\n".join(own))
        return 0
    packages: dict[str, Counter[str]] = {}
    for name in names:
        package, kind, _ = name.split("/")
        packages.setdefault(package, Counter())[kind] += 1
    for package, counts in packages.items():
        print(f"{package}: {_counted({kind: counts[kind] for kind in WORDS})}")
    return 0


def _type_names(structures: Any) -> set[str]:
    """The names of messages, services and actions, without the messages that those consist of."""
    names = set()
    for name in structures:
        package, kind, rest = name.split("/")
        if kind == "msg":
            names.add(name)
        elif (
            rest.endswith(("_Request", "_Goal"))
            and "_SendGoal" not in rest
            and "_GetResult" not in rest
        ):
            names.add(f"{package}/{kind}/{rest.rpartition('_')[0]}")
    return names


def make_parser(prog: str) -> Parser:
    parser = Parser(prog=prog, description="The definitions of messages, services and actions.")
    commands = parser.add_subparsers(metavar="COMMAND", required=True, dest="command")
    add = commands.add_parser("add", help="copy the definitions of packages beside the panel")
    add.add_argument("package", nargs="+", metavar="PACKAGE", help="such as nav2_msgs")
    add.add_argument(
        "--from",
        dest="source",
        type=Path,
        required=True,
        metavar="SOURCE",
        help="a folder (a package, a workspace, a checkout, an installed prefix such as"
        " /opt/ros/jazzy), a wheel, or the word robot: its nodes describe their topics' messages",
    )
    add.add_argument(
        "--to", type=Path, default=FOLDER, metavar="FOLDER", help="where to; default: %(default)s"
    )
    listed = commands.add_parser("list", help="list the packages that are built in")
    listed.add_argument("package", nargs="?", metavar="PACKAGE", help="list the types of this package")
    add_options(add)
    listed.add_argument("--distro", choices=DISTROS, help=f"of ROS 2; default: {DEFAULT_DISTRO}")
    return parser

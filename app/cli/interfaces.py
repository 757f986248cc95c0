"""`operator-panel interfaces add PACKAGE… --from SOURCE`: copies the definitions of ROS packages beside
a panel, so that it needs no workspace. `operator-panel interfaces list`: those that are built in.

Exit status: 0 done, 1 a package or a file is not there or can't be used, 2 a mistake on the command
line.
"""

import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

from app.cli.parser import Parser
from app.cli.robot.described_packages import described_packages
from app.cli.robot.link import DEFAULT_DISTRO, add_options, ended, place_of
from app.errors import InterfaceError, KioskError
from app.interfaces import DISTROS, load_interfaces
from app.interfaces.package_copy import Copied, copy_packages, opened_source, write_package

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

"""`operator-panel run | check | …`: each command is a module of this room."""

import sys
from argparse import ArgumentTypeError, RawDescriptionHelpFormatter
from collections.abc import Callable, Sequence
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from typing import NoReturn

from app.cli.parser import Parser
from app.settings import APP

COMMANDS = {
    "run": "serve a panel to browsers",
    "check": "check panel files: every fault with its place",
    "log": "check that the operator's log is as it was written",
    "simulate": "run the robot of a panel, or a recording, as a Zenoh peer of its own",
    "topics": "list the topics of a robot",
    "echo": "show the messages of a topic",
    "hz": "show how often a topic is published",
    "scaffold": "write a first panel that fits a running robot",
    "doctor": "find out what is wrong between a panel, this machine and the robot",
    "support": "collect what support needs to know in a zip file",
    "bridge-config": "write a configuration of the bridge that fits a panel",
    "completion": "print a shell's completion of these commands",
    "install": "install the panel as services of this machine",
    "update": "run another version, and back if it does not come up",
    "uninstall": "take the installation back; data stays",
    "kiosk": "show the panel on this machine's screen",
}
Command = Callable[[Sequence[str], str], int]


def main(arguments: Sequence[str] | None = None) -> int:
    """The exit status; `--help` and a mistake on the command line raise SystemExit."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    if not given:
        _parser().print_help(sys.stderr)
        return 2
    if given[0] not in COMMANDS:  # an option of this program, or a mistake
        parser = _parser()
        parser.parse_args(given[:1])
        parser.error(f"the command is missing: there is {', '.join(COMMANDS)}")
    return _command(given[0])(given[1:], f"{APP} {given[0]}")


def _command(name: str) -> Command:
    """Imported where it is used: to check a panel takes no HTTP server."""
    match name:
        case "run":
            from app.cli.run import main
        case "check":
            from app.cli.check import main
        case "log":
            from app.cli.log import main
        case "topics":
            from app.cli.topics import main
        case "echo":
            from app.cli.echo import main
        case "hz":
            from app.cli.hz import main
        case "scaffold":
            from app.cli.scaffold import main
        case "doctor":
            from app.cli.doctor import main
        case "support":
            from app.cli.support import main
        case "bridge-config":
            from app.cli.bridge_config import main
        case "completion":
            from app.cli.completion import print_completion

            return partial(print_completion, COMMANDS, _parser())
        case "install":
            from app.cli.install import install as main
        case "update":
            from app.cli.update import main
        case "uninstall":
            from app.cli.uninstall import main
        case "kiosk":
            from app.cli.kiosk import main
        case _:
            from app.cli.simulate import main
    return main


class _Parser(Parser):
    """Of the program itself: its one argument that is no option is a command."""

    def error(self, message: str) -> NoReturn:
        super().error(message.removeprefix("argument COMMAND: "))


def _known(word: str) -> str:
    if word in COMMANDS:
        return word
    if word.endswith(".toml"):
        raise ArgumentTypeError(f"did you mean {APP} run {word}?")
    raise ArgumentTypeError(f'"{word}" is not a command: there is {", ".join(COMMANDS)}')


def _parser() -> Parser:
    parser = _Parser(
        prog=APP,
        usage=f"{APP} [-h] [--version] COMMAND ...",
        description="An operator's touch panel for ROS 2 robots.",
        epilog="commands:\n"
        + "".join(f"  {name:15}{text}\n" for name, text in COMMANDS.items())
        + f"\n`{APP} COMMAND --help` tells the options of a command.",
        formatter_class=RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"{APP} {_version()}")
    parser.add_argument("command", nargs="?", metavar="COMMAND", type=_known, help="one of those below")
    return parser


def _version() -> str:
    try:
        return version(APP)
    except PackageNotFoundError:
        return "(a checkout, not installed)"

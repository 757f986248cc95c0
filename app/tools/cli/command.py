"""The command `operator-panel`, and the table of its commands."""

import gc
import sys
from argparse import ArgumentTypeError, RawDescriptionHelpFormatter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from typing import Final, NoReturn, Protocol, cast

from app.system.settings import APP
from app.tools.cli.parser import USAGE_ERROR, Parser, until_closed

# The commands of `operator-panel`: what each does, and its module.


class CommandModule(Protocol):
    """What the module of a command has."""

    def main(self, arguments: Sequence[str], prog: str) -> int:
        """Runs the command; its exit status. `prog` stands before the arguments in its help."""

    def make_parser(self, prog: str) -> Parser: ...


@dataclass(frozen=True, slots=True)
class Command:
    """`about` is its line in the help, `module` the name of its module in this room."""

    about: str
    module: str

    def load(self) -> CommandModule:
        """Its module, imported where it is used: to check a panel takes no HTTP server."""
        gc.disable()  # to look at all modules several times would take a third of a command's start
        try:
            module = import_module(f"{__package__}.{self.module}")
        finally:
            gc.enable()
        gc.freeze()  # nor are they looked at when it ends
        return cast(CommandModule, module)


COMMANDS: Final[Mapping[str, Command]] = {
    "run": Command("serve a panel to browsers", "run"),
    "check": Command("check panel files: every fault with its place", "check"),
    "prove": Command("prove a panel on its simulated robot: each lock, hold and alarm", "prove"),
    "edit": Command("edit a panel file in the browser", "edit"),
    "send": Command("send a panel file to a kiosk", "send"),
    "log": Command(
        "check the operator's log; print its key, or the panel that was shown at a time", "log"
    ),
    "simulate": Command(
        "run the robot of a panel, or a recording, as a Zenoh peer of its own", "simulate"
    ),
    "topics": Command("list the topics of a robot", "robot.topics"),
    "echo": Command("show the messages of a topic", "robot.echo"),
    "hz": Command("show how often a topic is published", "robot.hz"),
    "scaffold": Command("write a first panel that fits a running robot", "robot.scaffold"),
    "doctor": Command("find out what is wrong between a panel, this machine and the robot", "doctor"),
    "support": Command("collect what support needs to know in a zip file", "support"),
    "parcel": Command("collect what is known of a stop in a zip file for the vendor", "parcel"),
    "manual": Command("write the printable manual of a panel", "manual"),
    "sbom": Command("list what is installed, and check it against a VEX file", "sbom"),
    "backup": Command("write the data and the panel file of a panel to a zip file", "backup"),
    "restore": Command("put the data of a backup in place", "restore"),
    "forward": Command("send what the cell keeps to the plant's central database", "forward"),
    "central": Command("make, verify and prune the plant's central database", "central"),
    "recipes": Command("list, export and import the recipes of a panel", "recipes"),
    "places": Command("list and export the places that operators saved", "places"),
    "wall": Command("serve a wall: the state of all cells of a plant", "wall"),
    "users": Command("add, change and list users and tokens of programs", "users"),
    "bridge-config": Command("write a configuration of the bridge that fits a panel", "bridge_config"),
    "certificate": Command("make the certificate of the panel's own server", "certificate"),
    "interfaces": Command("copy the definitions of ROS packages beside a panel", "interfaces"),
    "router-config": Command(
        "write a configuration of the Zenoh router of a robot on rmw_zenoh", "router_config"
    ),
    "pki": Command("make the certificates of a panel, its bridge and its router", "pki"),
    "completion": Command("print a shell's completion of these commands", "completion"),
    "install": Command("install the panel as services of this machine", "install"),
    "update": Command("run another version, and back if it does not come up", "update"),
    "uninstall": Command("take the installation back; data stays", "uninstall"),
    "kiosk": Command("show the panel on this machine's screen", "kiosk"),
}


# `operator-panel run | check | …`: the program, whose first argument is a command.


def main(arguments: Sequence[str] | None = None) -> int:
    """The exit status; `--help` and a mistake on the command line raise SystemExit."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    return until_closed(lambda: _run(words))


def _run(words: list[str]) -> int:
    if not words:
        program_parser().print_help(sys.stderr)
        return USAGE_ERROR
    name = words[0]
    if name not in COMMANDS:  # an option of this program, or a mistake
        parser = program_parser()
        parser.parse_args([name])
        parser.error(f"the command is missing: there is {', '.join(COMMANDS)}")
    return COMMANDS[name].load().main(words[1:], f"{APP} {name}")


class _ProgramParser(Parser):
    """Of the program itself: its one argument that is no option is a command."""

    def error(self, message: str) -> NoReturn:
        super().error(message.removeprefix("argument COMMAND: "))


def _command_name(word: str) -> str:
    if word in COMMANDS:
        return word
    if word.endswith(".toml"):
        raise ArgumentTypeError(f"did you mean {APP} run {word}?")
    raise ArgumentTypeError(f'"{word}" is not a command: there is {", ".join(COMMANDS)}')


def program_parser() -> Parser:
    """Of the options before any command."""
    parser = _ProgramParser(
        prog=APP,
        usage=f"{APP} [-h] [--version] COMMAND ...",
        description="An operator's touch panel for ROS 2 robots.",
        epilog="commands:\n"
        + "".join(f"  {name:15}{command.about}\n" for name, command in COMMANDS.items())
        + f"\n`{APP} COMMAND --help` lists the options of a command.",
        formatter_class=RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"{APP} {_version()}")
    parser.add_argument(
        "command", nargs="?", metavar="COMMAND", type=_command_name, help="one of those below"
    )
    return parser


def _version() -> str:
    try:
        return version(APP)
    except PackageNotFoundError:
        return "(a checkout, not installed)"

"""The commands of `operator-panel`: what each does, and its module."""

import gc
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Final, Protocol, cast

from app.cli.parser import Parser


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
    "recipes": Command("list, export and import the recipes of a panel", "recipes"),
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

"""`operator-panel run | check | …`: the program, whose first argument is a command."""

import sys
from argparse import ArgumentTypeError, RawDescriptionHelpFormatter
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from typing import NoReturn

from app.cli.command_table import COMMANDS
from app.cli.parser import USAGE_ERROR, Parser
from app.cli.pipe import until_closed
from app.settings import APP


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


def _known(word: str) -> str:
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
    parser.add_argument("command", nargs="?", metavar="COMMAND", type=_known, help="one of those below")
    return parser


def _version() -> str:
    try:
        return version(APP)
    except PackageNotFoundError:
        return "(a checkout, not installed)"

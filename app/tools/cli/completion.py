"""`operator-panel completion bash | zsh | fish`: completion of its commands, made from their parsers.

Generated, not computed by a library at each key: a shell completes commands and options without
starting Python, and only the names of topics ask the robot. Source of the syntax: the manuals of bash
(`complete`, `compgen`), zsh (`bashcompinit`) and fish (`complete`).
"""

import argparse
import shlex
from collections.abc import Iterator, Sequence
from typing import Final

from app.system.settings import APP
from app.tools.cli.command import COMMANDS, program_parser
from app.tools.cli.parser import Parser

PROG = "python -m app.cli completion"
SHELLS: Final = ("bash", "zsh", "fish")
TOPIC: Final = "TOPIC"  # the argument of the commands whose argument is a topic's name
TOPICS: Final = f"{APP} topics --wait 1 2>/dev/null"

Parsers = Sequence[tuple[str, str, argparse.ArgumentParser]]  # (command, what it does, its parser)


def main(arguments: Sequence[str], prog: str = PROG) -> int:
    shell = make_parser(prog).parse_args(arguments).shell
    parsers = [
        (name, command.about, command.load().make_parser(f"{APP} {name}"))
        for name, command in COMMANDS.items()
    ]
    program = program_parser()  # of the options before any command
    print(_fish(parsers, program) if shell == "fish" else _bash(parsers, program, shell == "zsh"))
    return 0


def _words(parser: argparse.ArgumentParser) -> list[str]:
    """The options, and the words that its arguments are chosen from."""
    options = [option for action in parser._actions for option in action.option_strings]
    for action in parser._actions:
        if not action.option_strings and action.choices is not None:
            options += map(str, action.choices)
    return options


def _choices(parser: argparse.ArgumentParser) -> Iterator[tuple[list[str], list[str]]]:
    """(options, values) of the options whose value is one of several."""
    for action in parser._actions:
        if action.option_strings and action.choices is not None:
            yield list(action.option_strings), [str(choice) for choice in action.choices]


def _has_topic(parser: argparse.ArgumentParser) -> bool:
    return any(action.metavar == TOPIC for action in parser._actions)


def _bash(parsers: Parsers, program: argparse.ArgumentParser, with_zsh: bool) -> str:
    first = [*(name for name, _, _ in parsers), *_words(program)]
    lines = ["autoload -U +X bashcompinit && bashcompinit"] if with_zsh else []
    lines += [
        "_operator_panel() {",
        "  local current=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD-1]} words=",
        "  COMPREPLY=()",
        "  if [ $COMP_CWORD -eq 1 ]; then",
        f"    words={shlex.quote(' '.join(first))}",
        "  else",
        "    case ${COMP_WORDS[1]}:$before in",
    ]
    for name, _, parser in parsers:
        for options, values in _choices(parser):
            cases = "|".join(f"{name}:{option}" for option in options)
            lines.append(f"      {cases}) words={shlex.quote(' '.join(values))} ;;")
    lines += ["    esac", '    if [ -z "$words" ]; then', "    case ${COMP_WORDS[1]}:$current in"]
    for name, _, parser in parsers:
        if _has_topic(parser):
            lines.append(f"      {name}:/*) words=$({TOPICS}) ;;")
        lines.append(f"      {name}:*) words={shlex.quote(' '.join(_words(parser)))} ;;")
    lines += [
        "    esac",
        "    fi",
        "  fi",
        '  COMPREPLY=($(compgen -W "$words" -- "$current"))',
        "}",
        f"complete -o default -F _operator_panel {APP}",
    ]
    return "\n".join(lines)


def _fish(parsers: Parsers, program: argparse.ArgumentParser) -> str:
    first = f"complete -c {APP} -n __fish_use_subcommand"
    lines = [f"{first} {_fish_option(action)}" for action in program._actions if action.option_strings]
    for name, text, parser in parsers:
        lines.append(f"{first} -f -a {name} -d {shlex.quote(text)}")
        seen = f"complete -c {APP} -n '__fish_seen_subcommand_from {name}'"
        if _has_topic(parser):
            lines.append(f"{seen} -f -a {shlex.quote(f'({TOPICS})')}")
        lines += [f"{seen} {_fish_option(action)}" for action in parser._actions if _is_shown(action)]
    return "\n".join(lines)


def _is_shown(action: argparse.Action) -> bool:
    return bool(action.option_strings) or action.choices is not None


def _fish_option(action: argparse.Action) -> str:
    parts = []
    for option in action.option_strings:
        parts.append(f"-l {option[2:]}" if option.startswith("--") else f"-s {option[1:]}")
    if action.option_strings and action.nargs != 0:
        parts.append("-r")
    if action.choices is not None:
        parts.append(f"-f -a {shlex.quote(' '.join(map(str, action.choices)))}")
    help_text = (action.help or "").partition(";")[0].replace("%(default)s", str(action.default))
    return " ".join([*parts, f"-d {shlex.quote(help_text)}"])


def make_parser(prog: str) -> Parser:
    parser = Parser(
        prog=prog,
        description="Prints a shell's completion of commands, options and the robot's topics.",
        epilog=f'bash: eval "$({APP} completion bash)" in ~/.bashrc; zsh: the same in ~/.zshrc;'
        f" fish: {APP} completion fish > ~/.config/fish/completions/{APP}.fish",
    )
    parser.add_argument("shell", choices=SHELLS, metavar="SHELL", help="bash, zsh or fish")
    return parser

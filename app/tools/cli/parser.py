"""The parser of a command's arguments, and the end of a command whose reader has closed the pipe."""

import argparse
import os
import signal
import sys
from collections.abc import Callable
from difflib import get_close_matches
from typing import Any, Final, NoReturn

# The command line of every command: a mistake is one sentence.

USAGE_ERROR = 2


class Parser(argparse.ArgumentParser):
    """argparse's, without abbreviations; an error says what was wrong and where help is."""

    def __init__(self, **options: Any) -> None:
        super().__init__(allow_abbrev=False, **options)

    def parse_args(self, args: Any = None, namespace: Any = None) -> Any:
        parsed, unknown = self.parse_known_args(args, namespace)
        if unknown:  # options first: what follows one may be its value
            self.error(self._unknown(min(unknown, key=lambda word: not word.startswith("-"))))
        return parsed

    def _unknown(self, word: str) -> str:
        if not word.startswith("-"):
            return f'"{word}" is one argument too many'
        name = word.partition("=")[0]
        close = get_close_matches(name, self._option_string_actions, 1)
        hint = f": did you mean {close[0]}?" if close else ""
        return f"{name} is not an option of this command{hint}"

    def error(self, message: str) -> NoReturn:
        sys.stderr.write(f"{self.prog}: {message} (see {self.prog} --help)\n")
        sys.exit(USAGE_ERROR)


# A command whose output is closed before its end, as by `| head`.

CLOSED: Final = 128 + signal.SIGPIPE  # as a shell reports a program that ended by it


def until_closed(work: Callable[[], int]) -> int:
    """Its exit status; `CLOSED`, without a message, once what it writes can go nowhere."""
    try:
        try:
            return work()
        finally:
            sys.stdout.flush()
            sys.stderr.flush()
    except BrokenPipeError:
        nowhere = os.open(os.devnull, os.O_WRONLY)  # for the flush at exit
        os.dup2(nowhere, sys.stdout.fileno())
        os.dup2(nowhere, sys.stderr.fileno())
        return CLOSED

"""The command line of every command: a mistake is one sentence."""

import argparse
import sys
from difflib import get_close_matches
from typing import Any, NoReturn

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

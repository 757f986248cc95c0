"""The line numbers of the keys and tables of a TOML text, which Python's reader does not provide.

The text must be valid TOML: nothing is checked here. Source: TOML 1.0.0 (toml.io).
"""

import re
import tomllib
from bisect import bisect_right
from collections import Counter
from typing import Final

Path = tuple[str | int, ...]  # ("page", 0, "widget", 2, "topic")

_SPACE: Final = re.compile(r"(?:[ \t\r\n]|#[^\n]*)*")
_BARE: Final = re.compile(r"[A-Za-z0-9_-]+")
_QUOTED: Final = re.compile(r'"(?:\\.|[^"\\])*"|\'[^\']*\'')
_DOT: Final = re.compile(r"[ \t]*\.[ \t]*")
# The longest first: three quotes are not an empty string and a quote.
_VALUE: Final = re.compile(
    r'"""(?:\\.|[^\\])*?"""{1,3}(?!")'
    r"|'''.*?'''{1,3}(?!')"
    r'|"(?:\\.|[^"\\])*"'
    r"|'[^']*'"
    r"|[^,\]}#\n]+",
    re.DOTALL,
)


def lines_of(text: str) -> dict[Path, int]:
    """Path → line (from 1) of every key, table and list element; a table's line is that of its
    header."""
    scanner = _Scanner(text)
    scanner.document()
    return scanner.lines


class _Scanner:
    def __init__(self, text: str) -> None:
        self.lines: dict[Path, int] = {}
        self._text = text
        self._at = 0
        self._ends = [match.start() for match in re.finditer("\n", text)]
        self._tables: Counter[Path] = Counter()  # number of [[headers]] so far

    def document(self) -> None:
        table: Path = ()
        while self._peek():
            if self._text[self._at] == "[":
                table = self._header()
            else:
                self._pair(table)

    def _peek(self) -> str:
        """The next character after spaces and comments; "" at the end."""
        self._match(_SPACE)
        return self._text[self._at : self._at + 1]

    def _match(self, pattern: re.Pattern[str]) -> str:
        """Consumes and returns what a pattern matches here; "" without a match."""
        match = pattern.match(self._text, self._at)
        if match is None:
            return ""
        self._at = match.end()
        return match[0]

    def _line(self) -> int:
        return bisect_right(self._ends, self._at - 1) + 1

    def _header(self) -> Path:
        """The path of the table that a header opens: `[a.b]`, or the next one of `[[a.b]]`."""
        line, many = self._line(), self._text.startswith("[[", self._at)
        self._at += 2 if many else 1
        *above, last = self._key()
        self._at += 2 if many else 1
        path: Path = ()
        for part in above:
            path = self._newest((*path, part))
            self.lines.setdefault(path, line)
        path = (*path, last)
        if many:
            self.lines.setdefault(path, line)
            self._tables[path] += 1
            path = self._newest(path)
        self.lines[path] = line
        return path

    def _newest(self, path: Path) -> Path:
        """The path of a table, or of the last one of an array of tables."""
        return (*path, self._tables[path] - 1) if path in self._tables else path

    def _key(self) -> list[str]:
        """The parts of a key: `a."b.c"` has two. Consumes spaces after it."""
        parts = []
        while True:
            self._match(_SPACE)
            quoted = self._match(_QUOTED)
            parts.append(tomllib.loads(f"_ = {quoted}")["_"] if quoted else self._match(_BARE))
            if not self._match(_DOT):
                self._match(_SPACE)
                return parts

    def _pair(self, table: Path) -> None:
        line = self._line()
        path = table
        for part in self._key():
            path = (*path, part)
            self.lines.setdefault(path, line)
        self._at += len("=")
        self._peek()
        self._value(path)

    def _value(self, path: Path) -> None:
        match self._text[self._at]:
            case "[":
                self._list(path)
            case "{":
                self._inline_table(path)
            case _:
                self._match(_VALUE)

    def _list(self, path: Path) -> None:
        self._at += 1
        index = 0
        while self._peek() != "]":
            self.lines[*path, index] = self._line()
            self._value((*path, index))
            index += 1
            self._comma()
        self._at += 1

    def _inline_table(self, path: Path) -> None:
        self._at += 1
        while self._peek() != "}":
            self._pair(path)
            self._comma()
        self._at += 1

    def _comma(self) -> None:
        if self._peek() == ",":
            self._at += 1

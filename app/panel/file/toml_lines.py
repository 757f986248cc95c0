"""The places of the keys and tables of a TOML text, which Python's reader does not provide.

The text must be valid TOML: nothing is checked here. Source: TOML 1.0.0 (toml.io).
"""

import re
import tomllib
from bisect import bisect_right
from collections import Counter
from typing import Final, NamedTuple

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


class Span(NamedTuple):
    """A part of a text, by the offsets of its first character and of the one after its last."""

    start: int
    end: int


class Header(NamedTuple):
    """The header of a table: `[a.b]`, or `[[a.b]]` (`many`). `path` is that of the table, `span` goes
    from the first bracket to the last one."""

    path: Path
    keys: tuple[str, ...]
    many: bool
    span: Span


class Layout(NamedTuple):
    """The headers in their order, and the span of each key with its value, or of a list's element. In
    `pairs` are (table, first part of the key, span) of the keys that are in no value."""

    headers: list[Header]
    spans: dict[Path, Span]
    pairs: list[tuple[Path, str, Span]]


def lines_of(text: str) -> dict[Path, int]:
    """Path → line (from 1) of every key, table and list element; a table's line is that of its
    header."""
    scanner = _Scanner(text)
    scanner.document()
    return scanner.lines


def layout_of(text: str) -> Layout:
    scanner = _Scanner(text)
    scanner.document()
    return scanner.layout


class _Scanner:
    def __init__(self, text: str) -> None:
        self.lines: dict[Path, int] = {}
        self.layout = Layout([], {}, [])
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
                path, span = self._pair(table)
                self.layout.pairs.append((table, str(path[len(table)]), span))

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
        line, many, start = self._line(), self._text.startswith("[[", self._at), self._at
        self._at += 2 if many else 1
        keys = self._key()
        *above, last = keys
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
        self.layout.headers.append(Header(path, tuple(keys), many, Span(start, self._at)))
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

    def _pair(self, table: Path) -> tuple[Path, Span]:
        line, start = self._line(), self._at
        path = table
        for part in self._key():
            path = (*path, part)
            self.lines.setdefault(path, line)
        self._at += len("=")
        self._peek()
        self._value(path)
        span = self._span(start)
        self.layout.spans[path] = span
        return path, span

    def _span(self, start: int) -> Span:
        """From `start` to here, without the spaces before this place."""
        return Span(start, start + len(self._text[start : self._at].rstrip()))

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
            start = self._at
            self._value((*path, index))
            self.layout.spans[*path, index] = self._span(start)
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

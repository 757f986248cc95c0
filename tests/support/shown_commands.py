"""The shell commands of README and documentation, and how each is tested."""

import re
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Final, Literal

from tests.support.parts import ROOT, TESTS

TABLE: Final = TESTS / "commands_in_docs.toml"
KINDS: Final = ("run", "elsewhere", "not_run")
# Of a row, beside "command".
KEYS: Final[Mapping[str, set[str]]] = {
    "run": {"says", "until", "status", "beside"},
    "elsewhere": {"test"},
    "not_run": {"why"},
}
FENCE: Final = re.compile(r"^( *)```(?:sh|bash|shell|console)\n(.*?)^ *```", re.DOTALL | re.MULTILINE)
COMMENT: Final = re.compile(r"(?:^|\s+)# .*$")


@dataclass(frozen=True, slots=True)
class Shown:
    """A command of a page; `place` is "docs/page.md:12"."""

    command: str
    place: str


@dataclass(frozen=True, slots=True, eq=False)
class Row:
    """A row of the table."""

    kind: Literal["run", "elsewhere", "not_run"]
    command: str
    values: Mapping[str, str | int]

    def fits(self, command: str) -> bool:
        pattern = ".*".join(map(re.escape, self.command.split("*")))
        return re.fullmatch(pattern, command, re.DOTALL) is not None

    def text(self, key: str) -> str:
        return str(self.values.get(key, ""))


def pages() -> list[Path]:
    return [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md")), ROOT / "bench/README.md"]


def commands_of(text: str) -> Iterator[tuple[int, str]]:
    """The commands in a page's blocks: line number and command, without comments. A line that ends
    with a backslash continues in the next one."""
    for block in FENCE.finditer(text):
        first = text.count("\n", 0, block.start()) + 2
        lines = enumerate(block[2].splitlines(), first)
        for number, line in lines:
            command = line
            while command.endswith("\\"):
                command = command[:-1].rstrip() + " " + next(lines)[1].strip()
            command = COMMENT.sub("", command).strip()
            if command:
                yield number, command


@cache
def shown() -> tuple[Shown, ...]:
    return tuple(
        Shown(command, f"{page.relative_to(ROOT)}:{number}")
        for page in pages()
        for number, command in commands_of(page.read_text(encoding="utf-8"))
    )


@cache
def rows() -> tuple[Row, ...]:
    """The rows of all kinds in the order of the file."""
    text = TABLE.read_text(encoding="utf-8")
    tables = tomllib.loads(text)
    kinds = re.findall(r"^\[\[(\w+)\]\]$", text, re.MULTILINE)
    left = {kind: iter(tables.get(kind, [])) for kind in KINDS}
    found_rows = []
    for kind in kinds:
        values = dict(next(left[kind]))
        command = values.pop("command")
        unknown = set(values) - KEYS[kind]
        assert not unknown, f"{TABLE.name}: [[{kind}]] {command!r} has no {', '.join(sorted(unknown))}"
        found_rows.append(Row(kind, command, values))
    return tuple(found_rows)


def row_of(command: str) -> Row | None:
    return next((row for row in rows() if row.fits(command)), None)


def commands_for(test: str) -> list[str]:
    """The commands that another test runs, each once, as pages show them."""
    mine = (
        shown_command.command
        for shown_command in shown()
        if (row := row_of(shown_command.command)) and row.text("test") == test
    )
    return list(dict.fromkeys(mine))


@cache
def beside() -> Mapping[str, Mapping[str, str]]:
    tables: Mapping[str, Mapping[str, str]] = tomllib.loads(TABLE.read_text(encoding="utf-8"))["beside"]
    return tables

"""The lines of a TOML text: every key, table and element that Python's reader finds, at its place."""

import tomllib
from collections.abc import Iterator
from typing import Any, Final

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.panel.file.toml_lines import Path, lines_of
from app.system.settings import PACKAGE
from tests.support.form import several
from tests.support.parts import ROOT

pytestmark = pytest.mark.promise("panel file")


def paths(value: Any, path: Path = ()) -> Iterator[Path]:
    """Every path in what Python's reader made of a text."""
    inner: Any = ()
    if isinstance(value, dict):
        inner = value.items()
    elif isinstance(value, list):
        inner = enumerate(value)
    for key, nested in inner:
        yield (*path, key)
        yield from paths(nested, (*path, key))


@pytest.mark.parametrize(
    ("text", "lines"),
    [
        ("", {}),
        ("# a = 1\n\n", {}),
        ("a = 1\nb = 2", {("a",): 1, ("b",): 2}),
        ("\r\n# c\r\na = 1\r\nb = 2\r\n", {("a",): 3, ("b",): 4}),
        ("a.b . c = 1\na.d = 2", {("a",): 1, ("a", "b"): 1, ("a", "b", "c"): 1, ("a", "d"): 2}),
        ("\"a.b\" = 1\n'c' = 2", {("a.b",): 1, ("c",): 2}),
        ('"\\u0041" = 1', {("A",): 1}),
        ("a = '''\n]\n'''\nb = 1", {("a",): 1, ("b",): 4}),
        ('a = """\n# "" \\"""\n"""""\nb = 1', {("a",): 1, ("b",): 4}),
        ("a = ''''''\nb = ''''''''\nc = 1", {("a",): 1, ("b",): 2, ("c",): 3}),
        ('a = "=] # \\" \\\\"\nb = 1', {("a",): 1, ("b",): 2}),
        ("a = 1979-05-27 07:32:00 # now\nb = 1", {("a",): 1, ("b",): 2}),
        ("a = [\n 1, # [\n [2,\n 3], ]\nb = 1", {
            ("a",): 1, ("a", 0): 2, ("a", 1): 3, ("a", 1, 0): 3, ("a", 1, 1): 4, ("b",): 5}),
        ("a = { b = 1, c.d = [\n2] }", {
            ("a",): 1, ("a", "b"): 1, ("a", "c"): 1, ("a", "c", "d"): 1, ("a", "c", "d", 0): 2}),
        ("\n[ a . b ] # c\nc = 1", {("a",): 2, ("a", "b"): 2, ("a", "b", "c"): 3}),
        ("[a.b]\n[a]\nc = 1", {("a",): 2, ("a", "b"): 1, ("a", "c"): 3}),
        ("[[a]]\n[[a]]\nb = 1\n[a.c]\n[[a.d]]\n[[a]]\n[[a.d]]\ne = 1", {
            ("a",): 1, ("a", 0): 1, ("a", 1): 2, ("a", 1, "b"): 3, ("a", 1, "c"): 4, ("a", 1, "d"): 5,
            ("a", 1, "d", 0): 5, ("a", 2): 6, ("a", 2, "d"): 7, ("a", 2, "d", 0): 7,
            ("a", 2, "d", 0, "e"): 8}),
        ("a = {}\nb = []\nc = 1", {("a",): 1, ("b",): 2, ("c",): 3}),
    ],
)  # fmt: skip
def test_a_path_has_the_line_that_it_stands_on(text: str, lines: dict[Path, int]) -> None:
    assert set(paths(tomllib.loads(text))) == set(lines)
    assert lines_of(text) == lines


@pytest.mark.parametrize(
    "text", [(PACKAGE / "panel.toml").read_text(), (ROOT / "pyproject.toml").read_text()]
)
def test_a_whole_file_has_a_line_for_every_path(text: str) -> None:
    lines, rows = lines_of(text), text.splitlines()
    assert set(lines) == set(paths(tomllib.loads(text)))
    for path, line in lines.items():
        if isinstance(path[-1], str):
            assert path[-1] in rows[line - 1], path


TRICKY: Final = (
    "1", "-0.5e3", "true", "inf", "1979-05-27T07:32:00Z", "1979-05-27 07:32:00", '""', "''", '"]"',
    "'}'", '"# no comment"', '"a = \\"b\\""', '"\\\\"', "'\\'", '"""\n[a]\nb = 1\n"""', "'''\n]]\n'''",
    '""""""', '"""a""""', '"""\\""""', '"""\\\n   x"""', "''''a'''''", '"""\r\n"""', '"[[x]]"',
)  # fmt: skip
BETWEEN: Final = ("", " ", "\t")
AROUND: Final = ("", " ", "\n", " # ] } , \" '\n", "\r\n\t", "\n\n# [[x]]\n")
KEYS: Final = st.one_of(
    st.text("abcXYZ019_-", min_size=1, max_size=3).map(lambda key: (key, key)),
    st.text("ab.# []={}'", max_size=3).map(lambda key: (f'"{key}"', key)),
    st.text('ab.# []={}"\\', max_size=3).map(lambda key: (f"'{key}'", key)),
)
Key = tuple[str, str]  # as it is written, as it is read


class Writer:
    """Writes a TOML text, and knows on which line each path begins."""

    def __init__(self, draw: st.DrawFn) -> None:
        self.text = ""
        self.lines: dict[Path, int] = {}
        self._draw = draw

    def one_of(self, *choices: Any) -> Any:
        return self._draw(st.sampled_from(choices))

    def write(self, text: str) -> None:
        self.text += text

    def mark(self, path: Path) -> None:
        self.lines.setdefault(path, self.text.count("\n") + 1)

    def keys(self, most: int = 3) -> list[Key]:
        return self._draw(st.lists(KEYS, max_size=most, unique_by=lambda key: key[1]))

    def pairs(self, path: Path, between: str, depth: int) -> list[Key]:
        keys = self.keys()
        for number, key in enumerate(keys):
            self.write(self.one_of(*BETWEEN) if between.endswith("\n") or number else "")
            self.pair(path, key, depth)
            self.write(between if between.endswith("\n") or number < len(keys) - 1 else "")
        return keys

    def pair(self, path: Path, key: Key, depth: int) -> None:
        """`key = value`, or `key.more.more = value`."""
        parts = [key, *(self.keys(2) if self.one_of(True, False) else ())]
        for written, read in parts:
            path = (*path, read)
            self.mark(path)
            self.write(written + ("." if len(path) else ""))
        self.text = self.text[:-1]
        self.write(self.one_of(*BETWEEN) + "=" + self.one_of(*BETWEEN))
        self.value(path, depth)

    def value(self, path: Path, depth: int) -> None:
        match self.one_of("plain", "list", "table") if depth else "plain":
            case "plain":
                self.write(self.one_of(*TRICKY))
            case "table":
                self.write("{ ")
                self.pairs(path, " , ", depth - 1)
                self.write("}")
            case "list":
                self.write("[")
                for index in range(self.one_of(0, 1, 3)):
                    self.write(("," if index else "") + self.one_of(*AROUND))
                    self.mark((*path, index))
                    self.value((*path, index), depth - 1)
                    self.write(self.one_of(*AROUND))
                self.write("]")

    def tables(self, path: Path, written: list[str], taken: list[Key], depth: int) -> None:
        """Tables with headers, and those in them."""
        for key, read in self.keys(2):
            if read in [read_key for _, read_key in taken]:
                continue
            name = [*written, key]
            many = self.one_of(0, 1, 2)  # 0: one table and no list
            for index in range(max(1, many)):
                inner = (*path, read)
                for above in range(1, len(inner) + 1):
                    self.mark(inner[:above])
                if many:
                    inner = (*inner, index)
                    self.mark(inner)
                header = self.one_of(".", " . ").join(name)
                self.write(f"[[{header}]]" if many else f"[{header}]")
                self.write(self.one_of("\n", " # ]\n", "\r\n"))
                own = self.pairs(inner, "\n", 2)
                if depth:
                    self.tables(inner, name, own, depth - 1)


@st.composite
def texts(draw: st.DrawFn) -> tuple[str, dict[Path, int]]:
    writer = Writer(draw)
    own = writer.pairs((), "\n", 3)
    writer.tables((), [], own, 2)
    return writer.text, writer.lines


@given(texts())
@settings(max_examples=several(25, 150), deadline=None)
def test_whatever_the_layout_each_path_has_its_line(written: tuple[str, dict[Path, int]]) -> None:
    text, lines = written
    assert set(paths(tomllib.loads(text))) == set(lines), "the test wrote what it meant"
    assert lines_of(text) == lines

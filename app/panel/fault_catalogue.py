"""A catalogue of a robot's faults: a CSV file with the texts of each code, in several languages.

The header names the columns: `code`, then `text`, `cause`, `consequence` and `action`, each alone for
the panel's own language, or as `text:ja` for another one. The file is UTF-8.
"""

import csv
from collections.abc import Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Final, NamedTuple, TextIO

from app.system.texts import PanelText

TEXTS: Final = ("text", "cause", "consequence", "action")
MAX_ROWS: Final = 100_000


class CatalogueError(ValueError):
    """A fault of the file; `line` counts from 1."""

    def __init__(self, message: str, line: int) -> None:
        super().__init__(f"line {line}: {message}")


class FaultTexts(NamedTuple):
    """The texts of one code; None where the file has none."""

    text: str | PanelText | None
    cause: str | PanelText | None
    consequence: str | PanelText | None
    action: str | PanelText | None


Catalogue = Mapping[str, FaultTexts]


def read_catalogue(path: Path, language: str) -> Catalogue:
    """The texts by code; `language` is the panel's own. CatalogueError names the line."""
    return _read(path, language, path.stat().st_mtime_ns)


@lru_cache(16)
def _read(path: Path, language: str, _changed: int) -> Catalogue:
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            return dict(_rows(file, language))
    except UnicodeDecodeError:
        raise CatalogueError("is not UTF-8: save the file as UTF-8", 1) from None


def _rows(file: TextIO, language: str) -> Iterator[tuple[str, FaultTexts]]:
    reader = csv.reader(file, strict=True)
    try:
        columns = [_column(name, language) for name in next(reader, [])]
        _check_columns(columns)
        lines: dict[str, int] = {}
        for row in filter(None, reader):
            if len(row) != len(columns):
                message = f"has {len(row)} values; the header has {len(columns)}"
                raise CatalogueError(message, reader.line_num)
            code = row[columns.index(("code", ""))].strip()
            _check_code(code, lines, reader.line_num)
            yield code, _texts(columns, row, language)
    except csv.Error as error:
        raise CatalogueError(str(error), reader.line_num) from None


def _column(name: str, language: str) -> tuple[str, str]:
    """(key, language) of a column; ("code", "") for the codes."""
    key, _, tag = name.strip().partition(":")
    return (key, "") if key == "code" else (key, tag or language)


def _check_columns(columns: list[tuple[str, str]]) -> None:
    for i, (key, tag) in enumerate(columns):
        if key not in ("code", *TEXTS):
            listed = ", ".join(("code", *TEXTS))
            raise CatalogueError(f'there is no column "{key}"; there are {listed}, and "text:ja"', 1)
        if (key, tag) in columns[:i]:
            raise CatalogueError(f'has the column {key} of "{tag}" twice', 1)
    if ("code", "") not in columns or "text" not in {key for key, _ in columns}:
        raise CatalogueError("the header needs the columns code and text", 1)


def _check_code(code: str, lines: dict[str, int], line: int) -> None:
    if not code:
        raise CatalogueError("has no code", line)
    if code in lines:
        raise CatalogueError(f'"{code}" is already the code of line {lines[code]}', line)
    if len(lines) == MAX_ROWS:
        raise CatalogueError(f"is one code too many: {MAX_ROWS} at most", line)
    lines[code] = line


def _texts(columns: list[tuple[str, str]], row: list[str], language: str) -> FaultTexts:
    def text(key: str) -> str | PanelText | None:
        texts = {
            tag: value.strip()
            for (name, tag), value in zip(columns, row, strict=True)
            if name == key and value.strip()
        }
        return PanelText(texts, language) if texts else None

    return FaultTexts(*(text(key) for key in TEXTS))

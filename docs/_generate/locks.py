"""The tables of docs/reference/locks.md: each sentence that says why something is locked, refused or
ended, from the catalogue, with what to do about it, from locks.toml.

In another language the whole page, docs/reference/locks.<language>.md, is made of that catalogue, of
locks.<language>.toml (the advice) and of locks_pages.toml (what stands around the tables).
"""

import tomllib
from collections.abc import Mapping, Sequence
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, Final

from app.system.texts import ENGLISH, sentences
from app.system.texts.locales import own_name

SENTENCES: Final = sentences(ENGLISH)
FILE: Final = Path(__file__).with_name("locks.toml")
ADVICE: Final[Mapping[str, Any]] = tomllib.loads(FILE.read_text(encoding="utf-8"))
PAGES: Final = FILE.with_name("locks_pages.toml")
OTHERS: Final = "others"  # patterns of codes that lock nothing
COLUMNS: Final = ("What the panel says", "Code", "What to do")


def lock_tables() -> dict[str, str]:
    """The Markdown of each group, by its name, and of the links to other languages."""
    links = ", ".join(f"[{own_name(tag)}](locks.{tag}.md)" for tag in translations())
    tables = {f"locks {group}": _table(codes) for group, codes in groups(ADVICE).items()}
    return {"locks languages": f"In other languages: {links}." if links else ""} | tables


def groups(advice: Mapping[str, Any]) -> dict[str, Mapping[str, str]]:
    """The advice by codes, of each group."""
    return {group: codes for group, codes in advice.items() if group != OTHERS}


def translations(folder: Path = FILE.parent) -> dict[str, Path]:
    """The files with advice in other languages than English, by the language."""
    return {path.name.split(".")[1]: path for path in sorted(folder.glob("locks.*.toml"))}


def translated_page(language: str, path: Path) -> str:
    """The whole page; ValueError names what its files lack."""
    around = tomllib.loads(PAGES.read_text(encoding="utf-8")).get(language)
    if around is None:
        raise ValueError(f"{PAGES.name} has no [{language}]: what stands around the tables")
    advice = tomllib.loads(path.read_text(encoding="utf-8"))
    lines = ["---", "orphan: true", "---", f"# {around['title']}", "", around["about"].strip()]
    for group, codes in groups(ADVICE).items():
        own = advice.get(group, {})
        if wrong := sorted(codes.keys() ^ own.keys()):
            raise ValueError(f"{path.name}: [{group}] lacks or has too much: {', '.join(wrong)}")
        table = _table({code: own[code] for code in codes}, language, around["columns"])
        lines += ["", f"## {around['groups'][group]}", "", table]
    return "\n".join(lines) + "\n"


def unexplained() -> list[str]:
    """Codes of the catalogue for which no file says whether they lock, and what to do."""
    explained = {code for codes in groups(ADVICE).values() for code in codes}
    patterns = ADVICE[OTHERS]["codes"]
    return [
        code
        for code in SENTENCES
        if code not in explained and not any(fnmatchcase(code, pattern) for pattern in patterns)
    ]


def _table(codes: Mapping[str, str], language: str = ENGLISH, columns: Sequence[str] = COLUMNS) -> str:
    own = sentences(language)
    rows = [(shown(own[code]), f"`{code}`", advice) for code, advice in codes.items()]
    lines = [columns, ("---",) * 3, *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def shown(sentence: str) -> str:
    """With the names of what is filled in, so that Markdown takes nothing of it for its own."""
    return sentence.strip().replace("\n", " ").replace("{", "*{").replace("}", "}*").replace("|", "\\|")

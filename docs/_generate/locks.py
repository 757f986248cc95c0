"""The tables of docs/reference/locks.md: each sentence that tells why something is locked, refused or
ended, from the catalogue, with what to do about it, from locks.toml."""

import tomllib
from collections.abc import Mapping
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, Final

from app.i18n import ENGLISH, sentences

SENTENCES: Final = sentences(ENGLISH)
FILE: Final = Path(__file__).with_name("locks.toml")
ADVICE: Final[Mapping[str, Any]] = tomllib.loads(FILE.read_text(encoding="utf-8"))
OTHERS: Final = "others"  # patterns of codes that lock nothing


def lock_tables() -> dict[str, str]:
    """The Markdown of each group, by its name."""
    return {f"locks {group}": _table(codes) for group, codes in ADVICE.items() if group != OTHERS}


def unexplained() -> list[str]:
    """Codes of the catalogue of which nobody has said whether they lock, and what to do."""
    explained = {code for group, codes in ADVICE.items() if group != OTHERS for code in codes}
    patterns = ADVICE[OTHERS]["codes"]
    return [
        code
        for code in SENTENCES
        if code not in explained and not any(fnmatchcase(code, pattern) for pattern in patterns)
    ]


def _table(codes: Mapping[str, str]) -> str:
    rows = [(shown(SENTENCES[code]), f"`{code}`", advice) for code, advice in codes.items()]
    lines = [("What the panel says", "Code", "What to do"), ("---",) * 3, *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def shown(sentence: str) -> str:
    """With the names of what is filled in, so that Markdown takes nothing of it for its own."""
    return sentence.strip().replace("{", "*{").replace("}", "}*").replace("|", "\\|")

"""Troubleshooting quotes the sentences of the screen as they are in the catalogue."""

import re
from typing import Final

import pytest

from app.system.texts import ENGLISH, sentences
from tests.support.parts import ROOT

PAGE: Final = (ROOT / "docs/troubleshooting.md").read_text(encoding="utf-8")
FROM_ELSEWHERE: Final = {"failed to create array for field 'names'", "—"}
BLANK: Final = "…"  # in place of a name or value


def quotes(page: str) -> list[str]:
    """The quoted sentences, without code, with a blank for each italic name."""
    prose = re.sub(r"```.*?```|`[^`\n]*`", "", page, flags=re.DOTALL)
    quoted = (" ".join(text.split()) for text in re.findall(r'"([^"]+)"', prose))
    return [re.sub(r"\*[^*]+\*", BLANK, text.removeprefix(f"{BLANK} ")) for text in quoted]


def shown() -> set[str]:
    """Every sentence of the catalogue, with a blank for each placeholder."""
    return {re.sub(r"\{\w+\}", BLANK, text) for text in sentences(ENGLISH).values()}


@pytest.mark.parametrize("quote", sorted(set(quotes(PAGE)) - FROM_ELSEWHERE))
def test_quoted_sentences_are_in_the_catalogue(quote: str) -> None:
    assert quote in shown()


def test_troubleshooting_quotes_the_sentences_of_locks() -> None:
    section = PAGE.split("## One button is locked\n")[1].split("\n## ")[0]
    rows = [line for line in section.splitlines() if line.startswith("| ")][2:]
    assert len(rows) > 15
    assert [row for row in rows if not row.startswith('| "')] == []

"""CSV as spreadsheets read it: cells that are no formulas, and tables in chunks."""

import pytest

from app.system.csv_text import BOM, ROWS_AT_ONCE, csv_chunks, quoted_cell, text_cell, text_in_cell

FORMULAS = ("=1", "+1", "-1", "@x", "\tx", "\rx")


@pytest.mark.parametrize(
    ("text", "cell"),
    [
        ("", ""),
        ("a=1", "a=1"),
        ("'a", "'a"),
        ("a\nb", "a\nb"),
        ("a\u202eb", "a\\u202eb"),
        ("\rx", "\\u000dx"),
        *((text, f"'{text}") for text in FORMULAS if text[0] != "\r"),
    ],
)
def test_no_text_is_a_formula_and_none_is_hidden(text: str, cell: str) -> None:
    assert text_cell(text) == cell


@pytest.mark.parametrize("text", ["", "a", "'a", "''a", "'=1", *FORMULAS])
def test_a_quoted_cell_is_read_as_its_text(text: str) -> None:
    assert text_in_cell(quoted_cell(text)) == text
    assert not quoted_cell(text).startswith(("=", "+", "-", "@", "\t", "\r"))


@pytest.mark.parametrize("count", [0, 1, ROWS_AT_ONCE, ROWS_AT_ONCE + 1])
def test_chunks_are_one_table_read_from_its_last_row_on(count: int) -> None:
    asked: list[int | None] = []

    def read(last: int | None) -> list[int]:
        asked.append(last)
        first = 0 if last is None else last + 1
        return list(range(first, min(first + ROWS_AT_ONCE, count)))

    chunks = list(csv_chunks(["n", "text"], read, lambda n: (n, "a,b")))
    lines = [f'{n},"a,b"\r\n' for n in range(count)]
    assert b"".join(chunks).decode() == BOM + "n,text\r\n" + "".join(lines)
    assert asked == [None, *([ROWS_AT_ONCE - 1] if count >= ROWS_AT_ONCE else [])]

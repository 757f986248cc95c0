"""Mistakes of people who know other formats: each says what would be right, in its own line."""

from pathlib import Path
from typing import Final

import pytest

from app.panel.file.toml_file import parse_toml
from app.system.errors import PanelError

GOOD: Final = """title = "Cell"
mode = "live"

[[page]]
id = "one"
title = "One"

[[page.widget]]
id = "go"
kind = "publish"
label = "Go"
topic = "/go"
message = { data = true }
max = 10
"""


@pytest.mark.parametrize(
    ("old", "new", "line", "words"),
    [
        ('title = "Cell"', 'title = "Cell', 1, 'a text has no closing ": title = "Cell'),
        ('title = "Cell"', "title = “Cell”", 1, '“ is no quotation mark of TOML: write "…"'),
        ('title = "Cell"', "title = Cell", 1, 'a text stands in quotes: write "Cell"'),
        ('title = "Cell"', "title = Robot cell 1", 1, 'write "Robot cell 1"'),
        ('title = "Cell"', "title: Cell", 1, 'no colon: write title = "Cell"'),
        ('title = "Cell"', "title:", 1, "stand on one line with =: title = …"),
        ('title = "Cell"', "title =", 1, '"title" has no value'),
        ('title = "Cell"', 'title = "C:\\cell"', 1, r"a backslash in a text is written twice: \\"),
        ('title = "Cell"', 'title = """Cell', 1, 'a text has no closing """: title = """Cell'),
        ('mode = "live"', 'mode = "live" // robot', 2, "a comment begins with #, not //"),
        ('mode = "live"', "-- robot", 2, "a comment begins with #, not --"),
        ('mode = "live"', 'mode = "live";', 2, "nothing stands after a value: remove ;"),
        ('mode = "live"', 'mode = "live",', 2, "nothing stands after a value: remove ,"),
        ('mode = "live"', 'my mode = "live"', 2, "a key has no spaces: write my_mode"),
        ('mode = "live"', 'mode = "live"\nscreens = ["1x1",\nlanguage = "en"', 3, "no closing ]"),
        ("{ data = true }", "{ data = True }", 13, "True is not a value of TOML: write true"),
        ("{ data = true }", "{ data = yes }", 13, "yes is not a value of TOML: write true"),
        ("{ data = true }", "{ data = true, }", 13, "no comma stands before }"),
        ("{ data = true }", "{\n  data = true\n}", 13, "like [page.widget.message]"),
        ("{ data = true }", "{ data = –1 }", 13, "– is a dash: a negative number has -"),
        ("max = 10", "max = None", 14, 'None is not a value of TOML: leave out "max"'),
        ("max = 10", "max = 10,5", 14, "a number has a point: write 10.5"),
        ("max = 10", "max = .5", 14, "write 0.5"),
        ("max = 10", "max = -5.", 14, "write -5.0"),
        ("max = 10", "max = 010", 14, "a number has no 0 before it: write 10"),
        ("max = 10", 'label = "Again"', 14, '"label" is above already, in line 11'),
        ("[[page]]", "[[page]", 4, "the same on both sides: write [[page]]"),
        ("[[page]]", "[[page]]\n[[page.widget]]\nid = 1\n[page.widget]", 7, "must be [[page.widget]]"),
        ("[[page.widget]]", "[page.widget]\n[[page.widget]]", 8, "must be [[page.widget]]"),
        ("[[page]]", "[control]\n[control]\n[[page]]", 5, "[control] is above already, in line 4"),
        (GOOD, '{ "title": "Cell" }', 1, "this looks like JSON; a panel file is TOML"),
    ],
)
def test_a_line_that_is_no_toml_says_what_would_be_right(
    old: str, new: str, line: int, words: str
) -> None:
    assert old in GOOD
    with pytest.raises(PanelError) as raised:
        parse_toml(Path("cell.toml"), GOOD.replace(old, new, 1).encode())
    (fault,) = raised.value.faults
    assert words in str(fault)
    assert fault.line == line


def test_an_unknown_mistake_keeps_the_words_of_the_reader() -> None:
    with pytest.raises(PanelError) as raised:
        parse_toml(Path("cell.toml"), b'title = "Cell" "Cell"\n')
    (fault,) = raised.value.faults
    assert (fault.line, fault.message) == (1, "Expected newline or end of document after a statement")

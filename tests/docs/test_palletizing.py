"""The pages about the shipped panels quote them word for word.

An excerpt is one table of a panel file, from its first line to its last. `# …` stands for one or
more lines that are left out. Empty lines and lines of comment are left out without a sign. An empty
line separates excerpts.
"""

import re
from typing import Final

import pytest

from tests.support.parts import ROOT

pytestmark = pytest.mark.promise("documents")

PANELS: Final = {
    "docs/palletizing.md": "app/panel.toml",
    "docs/how-to/mobile-robot.md": "docs/examples/mobile-robot/panel.toml",
}
TEXTS: Final = {
    page: tuple((ROOT / path).read_text(encoding="utf-8") for path in (page, panel))
    for page, panel in PANELS.items()
}
PANEL: Final = TEXTS["docs/palletizing.md"][1]
LEFT_OUT: Final = "# …"
GUARD: Final = '[[interlock]]\nid = "guard"\ntopic = "/guard_locked"\nmax_age_s = 3.0\n'


def excerpts(page: str) -> list[str]:
    blocks = re.findall(r"^```toml\n(.*?)^```", page, re.DOTALL | re.MULTILINE)
    return [excerpt for block in blocks for excerpt in re.split(r"\n\n+", block.strip("\n"))]


def tables(panel: str) -> list[str]:
    """The tables of a panel file, the keys above the first one included."""
    lines = [line for line in panel.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    return re.split(r"^(?=\[)", "\n".join(lines) + "\n", flags=re.MULTILINE)


def quoted(excerpt: str, panel: str) -> list[str]:
    """The tables that an excerpt quotes."""
    lines = [
        r"(?:.*\n)+" if line.strip() == LEFT_OUT else re.escape(f"{line}\n")
        for line in excerpt.splitlines()
    ]
    return [table for table in tables(panel) if re.fullmatch("".join(lines), table)]


@pytest.mark.parametrize("page", PANELS)
def test_page_has_excerpts(page: str) -> None:
    assert excerpts(TEXTS[page][0])


@pytest.mark.parametrize(
    ("excerpt", "panel"),
    [(excerpt, panel) for page, panel in TEXTS.values() for excerpt in excerpts(page)],
)
def test_excerpt_quotes_one_table_of_the_shipped_panel(excerpt: str, panel: str) -> None:
    assert len(quoted(excerpt, panel)) == 1, excerpt


@pytest.mark.parametrize(
    ("excerpt", "is_quoted"),
    [
        (GUARD, True),
        ('[[interlock]]\nid = "guard"\n# …\nmax_age_s = 3.0', True),
        ('[[interlock]]\nid = "guard"\n# …', True),
        ('[[interlock]]\nid = "guard"', False),
        ('[[interlock]]\nid = "guard"\nmax_age_s = 3.0', False),
        (GUARD.replace("3.0", "2.0"), False),
        (f"{GUARD}# …", False),
        ('[[interlock]]\nid = "guard"\n# …\nid = "other"', False),
    ],
    ids=["whole", "middle", "end", "end unsaid", "middle unsaid", "changed", "nothing left out", "two"],
)
def test_lines_are_left_out_with_a_sign_only(excerpt: str, is_quoted: bool) -> None:
    panel = f'title = "Cell"\n\n# The door.\n{GUARD}\n[[interlock]]\nid = "other"\n'
    assert bool(quoted(excerpt, panel)) is is_quoted

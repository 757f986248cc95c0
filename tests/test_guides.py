"""What the guides in docs/ show can be used as it stands there."""

import re
from pathlib import Path
from typing import Final

import pytest

from app.panel import load_panel
from tests.parts import ROOT

DOCS: Final = ROOT / "docs"
OWN: Final = '# interfaces = ["cell_msgs"]'
JOG: Final = "float64 speed\nuint32 valid_ms\nuint16 number\n"
ALL_KINDS: Final = {
    *("text", "slider", "publish", "call", "action", "parameter", "hold", "readout", "indicator")
}


def examples(name: str) -> list[str]:
    """The TOML blocks of a page."""
    text = (DOCS / name).read_text()
    return re.findall(r"^```toml\n(.*?)^```", text, re.DOTALL | re.MULTILINE)


GUIDE: Final = examples("panel-file.md")
HOW_TOS: Final = [f"how-to/{path.name}" for path in sorted((DOCS / "how-to").glob("*.md"))]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder for a panel file, with the message of the hold's example."""
    messages = tmp_path / "cell_msgs/msg"
    messages.mkdir(parents=True)
    (messages / "Jog.msg").write_text(JOG)
    return tmp_path


def kinds(folder: Path, *blocks: str) -> set[str]:
    """The kinds of widgets of a panel that these blocks are."""
    whole = "\n".join(blocks)
    assert OWN in whole
    panel = folder / "cell1.toml"
    panel.write_text(whole.replace(OWN, OWN.removeprefix("# ")))
    return {widget.kind for widget in load_panel(panel).widgets()}


def test_the_first_panel_is_good_as_it_is(tmp_path: Path) -> None:
    panel = tmp_path / "cell1.toml"
    panel.write_text(GUIDE[0])
    assert load_panel(panel).title == "Robot cell 1"


@pytest.mark.parametrize("name", [name for name in HOW_TOS if examples(name)])
def test_the_example_of_each_how_to_fits_the_guides_panel(folder: Path, name: str) -> None:
    assert kinds(folder, *GUIDE, *examples(name)) >= kinds(folder, *GUIDE)


def test_all_examples_together_are_a_panel(folder: Path) -> None:
    found = kinds(folder, *GUIDE, *(block for name in HOW_TOS for block in examples(name)))
    assert found >= ALL_KINDS


@pytest.mark.parametrize("path", sorted((DOCS / "examples").glob("*.toml")), ids=lambda path: path.name)
def test_each_example_panel_is_good(path: Path) -> None:
    assert load_panel(path).mode == "demo"

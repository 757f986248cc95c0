"""What the README shows can be used as it stands there."""

import re
import tomllib
from pathlib import Path
from typing import Final

import pytest

from app.panel import load_panel
from tests.support.parts import ROOT

pytestmark = pytest.mark.promise("documents")

TEXT: Final = (ROOT / "README.md").read_text()


def links(name: str) -> set[str]:
    """The files that a page at the top links to."""
    targets = re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", (ROOT / name).read_text())
    return set(targets)


@pytest.mark.parametrize("name", ["README.md", "CONTRIBUTING.md"])
def test_each_link_leads_to_a_page_of_the_documentation_or_to_a_file(name: str) -> None:
    pages = re.findall(r"^[a-z][\w/-]*$", (ROOT / "docs/index.md").read_text(), re.MULTILINE)
    known = {f"docs/{page}.md" for page in pages}  # `make docs` looks whether they are there
    assert len(links(name)) >= 3
    assert [link for link in links(name) - known if not (ROOT / link).is_file()] == []


def test_panel_of_the_readme_is_valid(tmp_path: Path) -> None:
    (example,) = re.findall(r"^```toml\n(.*?)^```", TEXT, re.DOTALL | re.MULTILINE)
    path = tmp_path / "cell1.toml"
    path.write_text(example)
    panel = load_panel(path)
    assert (panel.mode, [widget.id for widget in panel.widgets()]) == ("live", ["start"])


def test_readme_stays_short() -> None:
    assert len(TEXT.splitlines()) <= 150


def test_each_make_target_in_the_readme_exists() -> None:
    makefile = (ROOT / "Makefile").read_text()
    targets = set(re.findall(r"\bmake ([a-z]+)", TEXT))
    assert {"run", "test"} <= targets
    assert [target for target in targets if not re.search(rf"^{target}:", makefile, re.MULTILINE)] == []


def test_each_dependency_has_its_reason() -> None:
    with (ROOT / "pyproject.toml").open("rb") as file:
        described = tomllib.load(file)
    groups = described["dependency-groups"]
    wanted = [*described["project"]["dependencies"], *groups["dev"]]
    wanted += [requirement for requirement in groups["test"] if isinstance(requirement, str)]
    rows = TEXT.split("## Dependencies")[1]
    names = {re.split(r"[^\w-]", requirement, maxsplit=1)[0] for requirement in wanted}
    assert "" not in names
    assert [name for name in sorted(names) if not re.search(rf"\b{name}\b", rows)] == []

"""The threats of SECURITY.md and the rows of the requirements name tests that exist."""

import ast
import re

import pytest

from tests.support.parts import ROOT

FILES = ("SECURITY.md", "docs/evidence.md")
PATH = re.compile(r"`(tests/[\w/]+\.py)(?=`|::)")
NAMED_IN_FILE = re.compile(r"`(tests/[\w/]+\.py)::(test_\w+)`")
NAME = re.compile(r"`(test_\w+)`")


def threats() -> list[list[str]]:
    """The cells of each row of the table of threats."""
    text = (ROOT / "SECURITY.md").read_text(encoding="utf-8")
    table = text.partition("## Threats and their tests")[2]
    rows = [line.strip("| ").split(" | ") for line in table.splitlines() if line.startswith("| ")]
    return [row for row in rows[1:] if not row[0].startswith("---")]


@pytest.mark.parametrize("file", FILES)
def test_each_named_file_has_tests(file: str) -> None:
    paths = set(PATH.findall((ROOT / file).read_text(encoding="utf-8")))
    assert paths
    for path in paths:
        assert "def test_" in (ROOT / path).read_text(encoding="utf-8"), path


def test_each_named_test_is_in_a_named_file() -> None:
    text = (ROOT / "SECURITY.md").read_text(encoding="utf-8")
    defined = {
        node.name
        for path in set(PATH.findall(text))
        for node in ast.walk(ast.parse((ROOT / path).read_text(encoding="utf-8")))
        if isinstance(node, ast.FunctionDef)
    }
    named = set(NAME.findall(text))
    assert named
    assert named <= defined


def test_each_threat_has_a_measure_and_a_test() -> None:
    rows = threats()
    assert len(rows) >= 13
    for row in rows:
        threat, measure, test = row
        assert threat
        assert measure
        assert PATH.search(test) or NAME.search(test) or test.startswith("the same"), threat


def test_each_row_of_the_requirements_names_tests_that_exist() -> None:
    text = (ROOT / "docs/evidence.md").read_text(encoding="utf-8")
    named = NAMED_IN_FILE.findall(text)
    assert len(named) >= 40
    lacking = [
        f"{path}::{name}"
        for path, name in named
        if f"def {name}(" not in (ROOT / path).read_text(encoding="utf-8")
    ]
    assert lacking == []


@pytest.mark.parametrize("heading", ["IEC 62443-4-2", "The machine", "EN 301 549"])
def test_each_row_has_a_state_and_its_evidence_or_a_reason(heading: str) -> None:
    text = (ROOT / "docs/evidence.md").read_text(encoding="utf-8")
    part = text.partition(f"\n## {heading}")[2].partition("\n## ")[0]
    rows = [line.strip("| ").split(" | ") for line in part.splitlines() if line.startswith("| ")][2:]
    assert len(rows) >= 9
    for row in rows:
        requirement, state, evidence = row
        assert re.match("met|partly|not met|installation", state), requirement
        assert PATH.search(evidence) or len(evidence) > 25, requirement

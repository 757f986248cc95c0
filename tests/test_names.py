"""Names of variables, parameters, functions and attributes are nouns: none is a pronoun."""

import ast
import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from tests.support.parts import ROOT

FOLDERS = ("app", "tests", "bench", "docs", "deploy")
PRONOUNS = {"one", "of", "what", "it", "given", "found"}
# A column of the operator's log, in files of all versions.
COLUMNS = ["app/records/entry.py: of"]


def names_in(tree: ast.Module) -> Iterator[str]:
    """The names that a module gives to something."""
    for node in ast.walk(tree):
        match node:
            case ast.Name(id=name, ctx=ast.Store()) | ast.Attribute(attr=name, ctx=ast.Store()):
                yield name
            case ast.arg(arg=name) | ast.alias(asname=str(name)) | ast.ExceptHandler(name=str(name)):
                yield name
            case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name) | ast.ClassDef(name=name):
                yield name
            case ast.MatchAs(name=str(name)) | ast.MatchStar(name=str(name)):
                yield name


def pronouns_in(path: Path) -> list[str]:
    names = {name.strip("_") for name in names_in(ast.parse(path.read_text(encoding="utf-8")))}
    return [f"{path.relative_to(ROOT)}: {name}" for name in sorted(names & PRONOUNS)]


def test_no_name_is_a_pronoun() -> None:
    """Parsed in another process: with threads Python 3.11.7 may fail to (gh-106905)."""
    code = (
        "import json; from tests.test_names import FOLDERS, ROOT, pronouns_in;"
        " files = [path for folder in FOLDERS for path in sorted((ROOT / folder).rglob('*.py'))];"
        " print(json.dumps([name for path in files for name in pronouns_in(path)]))"
    )
    output = subprocess.check_output([sys.executable, "-c", code], cwd=ROOT, text=True)
    assert json.loads(output) == COLUMNS

"""The scripts of pages: their imports go one way, and each of them is loaded by something."""

import posixpath
import re
from collections.abc import Mapping
from typing import Final

from app.web.assets import Assets
from tests.support.parts import ROOT

SCRIPTS: Final = ROOT / "static/js"
# Beside comments: at the start, or later by `import("…")`.
IMPORT: Final = re.compile(
    r'^(?:import|export)\b[^"();=]*"(\.{1,2}/[^"]+)"|\bimport\(\s*"([^"]+)"\)', re.MULTILINE
)
COMMENT: Final = re.compile(r"^\s*//.*$|/\*\*[^*]*\*/", re.MULTILINE)
# Named by a template, or in the page itself.
ENTRIES: Final = {"main", "guard", "print", "gallery", "wall", "editor/main"}


def imports() -> Mapping[str, frozenset[str]]:
    """What each script imports, at its start or later."""
    texts = {file.relative_to(SCRIPTS).as_posix(): file.read_text() for file in SCRIPTS.rglob("*.js")}
    return {
        script.removesuffix(".js"): frozenset(
            posixpath.normpath(
                posixpath.join(posixpath.dirname(script), at_start or later)
            ).removesuffix(".js")
            for at_start, later in IMPORT.findall(COMMENT.sub("", text))
        )
        for script, text in texts.items()
    }


def test_imports_of_scripts_have_no_circle() -> None:
    """Also of what is loaded later."""
    waiting = dict(imports())
    assert waiting["main"] > {"show", "ask"}
    assert all(names <= waiting.keys() for names in waiting.values())
    while free := [script for script, names in waiting.items() if not names & waiting.keys()]:
        for script in free:
            del waiting[script]
    assert waiting == {}


def test_each_script_is_loaded() -> None:
    loaded = {*ENTRIES, *(f"kinds/{script}" for script in Assets.scripts.values())}
    scripts = imports()
    assert scripts.keys() - loaded == frozenset().union(*scripts.values()) - loaded

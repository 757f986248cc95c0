"""The page until the server answers: it reads the panel file as the server will."""

import subprocess
import sys
from pathlib import Path

import pytest

from app.panel import load_panel
from app.system.texts import render, say
from app.system.texts.catalogue import files
from app.tools.kiosk.waiting_page import page_of
from tests.support.parts import ROOT

PANELS = (ROOT / "app/panel.toml", *sorted((ROOT / "docs/examples").glob("*.toml")))
HEAD = """
[[page]]
id = "main"
title = "Main"
"""


def languages(page: str) -> list[str]:
    """Those of its sentences, in their order."""
    return [part.split('"')[0] for part in page.split('<div lang="')[1:]]


@pytest.mark.parametrize("path", PANELS, ids=lambda path: path.stem)
def test_it_has_the_languages_and_the_title_of_the_panel(path: Path) -> None:
    panel, page = load_panel(path), page_of(path)
    others = [tag for tag in panel.readers_languages if tag != panel.language]
    assert languages(page) == [panel.language, *others]
    assert f"<h1>{render(panel.title, panel.language)}</h1>" in page
    for language in panel.readers_languages:
        assert render(say("kiosk_starting"), language) in page


@pytest.mark.parametrize(
    "text",
    [
        'title = "A"\n',
        'title = "A"\nlanguage = "ja"\n',
        'title = { de = "A" }\nlanguage = "de"\n',
        'title = "A"\nlanguages = ["en", "de"]\n',
    ],
)
def test_a_file_without_texts_in_several_languages(text: str, tmp_path: Path) -> None:
    path = tmp_path / "panel.toml"
    path.write_text(text + HEAD)
    panel = load_panel(path)
    assert sorted(languages(page_of(path))) == sorted(panel.readers_languages)
    assert languages(page_of(path))[0] == panel.language
    assert "<h1>A</h1>" in page_of(path)


@pytest.mark.parametrize("text", [None, "no = TOML = ", "title = 7\nlanguage = 7\nlanguages = [7]\n"])
def test_a_file_with_faults_is_waited_for_in_every_language(text: str | None, tmp_path: Path) -> None:
    path = tmp_path / "panel.toml"
    if text is not None:
        path.write_text(text)
    assert languages(page_of(path)) == list(files())


def test_it_imports_only_the_standard_library(tmp_path: Path) -> None:
    """It is on the screen while the server still loads."""
    script = (
        "import sys; from app.kiosk.waiting_page import main; main(sys.argv[1:]);"
        "print(*sorted({name.split('.')[0] for name in sys.modules} - sys.stdlib_module_names))"
    )
    panel, target = ROOT / "app/panel.toml", tmp_path / "waiting.html"
    command = [sys.executable, "-S", "-c", script, str(panel), str(target)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    assert set(done.stdout.split()) <= {"__main__", "app"}
    assert "Robot cell 1" in target.read_text()

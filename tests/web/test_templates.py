"""The pages' templates: compiled before the first page is asked for."""

import asyncio
from collections.abc import Iterator
from pathlib import Path

import pytest
from jinja2 import Environment, FileSystemLoader
from jinja2.meta import find_referenced_templates

from app.cell.view.publisher import SECTIONS
from app.panel.widgets.kinds import KINDS
from app.system.settings import shipped_path
from app.web.pages.compiled_templates import CompiledTemplates, compile_all, template_names
from app.web.pages.page_templates import PageTemplates
from app.web.routes.pages import compiled, is_of_a_page


def needed(environment: Environment, name: str) -> Iterator[str]:
    """The template, and all that it extends, imports and includes by name."""
    assert environment.loader is not None
    yield name
    source = environment.loader.get_source(environment, name)[0]
    for inner in find_referenced_templates(environment.parse(source)):
        if inner is not None:
            yield from needed(environment, inner)


def test_all_that_a_page_is_made_of_is_compiled_at_the_start() -> None:
    environment = Environment(loader=FileSystemLoader(shipped_path("templates")))
    asyncio.run(compiled(environment))
    assert environment.cache is not None
    names = [
        "screen.html",
        "_failed.html",
        "lock_help.html",
        *(f"widgets/{kind}.html" for kind in KINDS),
    ]
    names += [section.template for section in SECTIONS if section.template]
    expected = {inner for name in names for inner in needed(environment, name)}
    assert {key[1] for key in environment.cache} == expected


def templates_of(folder: Path) -> PageTemplates:
    folder.mkdir(exist_ok=True)
    (folder / "page.html").write_text("<p>{{ number('1.5') }}</p>")
    return PageTemplates(folder)


def test_compiled_templates_are_kept_for_the_next_start(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.dont_write_bytecode", False)
    assert templates_of(tmp_path).render("page.html", "en") == "<p>1.5</p>"
    monkeypatch.setattr(Environment, "_parse", None)  # nothing is compiled again
    again = templates_of(tmp_path)
    assert [again.render("page.html", language) for language in ("en", "de")] == [
        "<p>1.5</p>",
        "<p>1,5</p>",
    ]


def test_a_changed_template_is_compiled_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.dont_write_bytecode", False)
    templates_of(tmp_path).render("page.html", "en")
    changed = templates_of(tmp_path)
    (tmp_path / "page.html").write_text("<b>changed</b>")
    assert changed.render("page.html", "en") == "<b>changed</b>"


def test_templates_in_a_folder_that_cannot_be_written_are_compiled_each_time(tmp_path: Path) -> None:
    templates = templates_of(tmp_path)
    (tmp_path / "__pycache__").write_text("not a folder")
    assert templates.render("page.html", "en") == "<p>1.5</p>"


def test_the_templates_of_the_wheel_are_compiled(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    compile_all(shipped_path("templates"), tmp_path / "compiled")
    from_source = PageTemplates(shipped_path("templates"))
    monkeypatch.setattr(Environment, "_parse", None)  # nothing is compiled again
    monkeypatch.setattr(CompiledTemplates, "load_bytecode", lambda self, bucket: None)
    compiled_ones = PageTemplates(shipped_path("templates"), compiled=tmp_path / "compiled")
    environment = compiled_ones.environment("ja")
    names = template_names(environment, is_of_a_page)
    assert len(names) > len(KINDS)
    assert {environment.get_template(name).name for name in names} == {*names}
    monkeypatch.undo()
    context = {"widget": {"id": "a", "kind": "label", "label": "<A>"}, "why": "Not kept"}
    rendered = compiled_ones.render("_failed.html", "ja", **context)
    assert "&lt;A&gt;" in rendered
    assert "Not kept" in rendered
    assert rendered == from_source.render("_failed.html", "ja", **context)

"""The pages' templates: compiled before the first page is asked for."""

import asyncio
from collections.abc import Iterator

from jinja2 import Environment, FileSystemLoader
from jinja2.meta import find_referenced_templates

from app.panel.widgets.kinds import KINDS
from app.settings import shipped_path
from app.view.sections import SECTIONS
from app.web.routes.pages import compiled


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

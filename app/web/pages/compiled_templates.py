"""How the pages' templates are compiled: at the build of the wheel, else at their first use.

The wheel has them as Python modules, which pip compiles when it installs them: so they are there too
where the server can't write into its installation. This module needs Jinja only, as the build does.
"""

import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

from jinja2 import (
    BaseLoader,
    ChoiceLoader,
    Environment,
    FileSystemBytecodeCache,
    FileSystemLoader,
    ModuleLoader,
    StrictUndefined,
)
from jinja2.bccache import Bucket

COMPILED: Final = "compiled_templates"  # the folder in the installed package
FOR_DEVELOPMENT: Final = ("gallery.html",)  # not in the wheel


class CompiledTemplates(FileSystemBytecodeCache):
    """Compiled templates in `__pycache__` beside their sources, by the rules of Python's own bytecode:
    written where the folder can be written, used while the source is the same."""

    def __init__(self, folder: Path) -> None:
        super().__init__(str(folder / "__pycache__"), "%s.jinja.pyc")

    def load_bytecode(self, bucket: Bucket) -> None:
        with suppress(OSError):
            super().load_bytecode(bucket)

    def dump_bytecode(self, bucket: Bucket) -> None:
        if not sys.dont_write_bytecode:
            with suppress(OSError):
                Path(self.directory).mkdir(exist_ok=True)
                super().dump_bytecode(bucket)


def environment_of(folder: Path, compiled: Path | None = None) -> Environment:
    """The environment of the templates in a folder; `compiled` is where `compile_all` puts them, if it
    is there."""
    sources: BaseLoader = FileSystemLoader(folder)
    if compiled is not None and compiled.is_dir():
        sources = ChoiceLoader([ModuleLoader(compiled), sources])
    return Environment(
        loader=sources,
        autoescape=True,
        undefined=StrictUndefined,
        auto_reload=False,
        trim_blocks=True,
        lstrip_blocks=True,
        bytecode_cache=CompiledTemplates(folder),
        finalize=_unchanged,
    )


def _unchanged(value: Any) -> Any:
    """In the place of what renders a text in a language: the code that is compiled calls it."""
    return value


def template_names(environment: Environment, is_wanted: Callable[[str], bool]) -> list[str]:
    """The names of the templates with a source."""
    loader = environment.loader
    sources = loader.loaders[-1] if isinstance(loader, ChoiceLoader) else loader
    assert sources is not None
    return [name for name in sources.list_templates() if is_wanted(name)]


def compile_all(folder: Path, target: Path) -> None:
    """Writes each template of a folder into `target` as a module; an error if one can't be compiled."""
    environment = environment_of(folder)
    wanted = template_names(
        environment, lambda name: name.endswith(".html") and name not in FOR_DEVELOPMENT
    )
    environment.compile_templates(
        target, zip=None, filter_func=wanted.__contains__, ignore_errors=False
    )

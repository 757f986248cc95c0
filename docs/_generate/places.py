"""Where things are in the code: paths of HTTP, tables of the panel file, sentences.

Read from the code as it stands, so that the tables of docs/architecture.md and
docs/reference/sentences.md follow every move.
"""

import ast
import inspect
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any, Final

from app.panel.reference.schema import ROOT, models
from app.system import texts as i18n
from app.system.texts import BETWEEN, ENGLISH, sentences
from docs._generate.locks import shown

SENTENCES: Final = sentences(ENGLISH)
PROJECT: Final = Path(__file__).parents[2]
METHODS: Final = ("get", "post", "head", "put", "delete", "websocket")
CATALOGUE: Final = Path(inspect.getfile(i18n)).parent
GALLERY: Final = PROJECT / "tests/gallery/page.py"


@cache
def modules() -> dict[Path, ast.Module]:
    """Every module of `app/` but the catalogue of sentences, and the page of the gallery."""
    paths = [*sorted((PROJECT / "app").rglob("*.py")), GALLERY]
    return {
        path: ast.parse(path.read_text(encoding="utf-8"))
        for path in paths
        if CATALOGUE not in path.parents
    }


@cache
def nodes() -> dict[Path, tuple[ast.AST, ...]]:
    """Of each module, all nodes of its syntax tree."""
    return {path: tuple(ast.walk(tree)) for path, tree in modules().items()}


def place(path: Path) -> str:
    return f"`{path.relative_to(PROJECT)}`"


def paths_table() -> str:
    """Each path of HTTP of a panel's server, with the function that answers."""
    rows = [("Path", "Function", "File"), ("---",) * 3]
    for path, module_nodes in nodes().items():
        if "tools" in path.parts:  # the editor's server is for its own page
            continue
        texts = _constants(modules()[path])
        for node in module_nodes:
            if isinstance(node, ast.AsyncFunctionDef | ast.FunctionDef):
                routes = _routes(node, texts)
                rows += [(f"`{route}`", f"`{node.name}`", place(path)) for route in routes]
    return _markdown(sorted(rows[2:]), rows[:2])


def _constants(module: ast.Module) -> dict[str, object]:
    """The constants of a module by their names."""
    assigned = (node for node in module.body if isinstance(node, ast.AnnAssign))
    return {ast.unparse(n.target): n.value.value for n in assigned if isinstance(n.value, ast.Constant)}


def _routes(
    function: ast.AsyncFunctionDef | ast.FunctionDef, texts: Mapping[str, object]
) -> Iterator[str]:
    """The paths that a function answers: each is written there, or is one of the module's `texts`."""
    for decorator in function.decorator_list:
        match decorator:
            case ast.Call(func=ast.Attribute(attr=method), args=[path, *_]) if method in METHODS:
                route = path.value if isinstance(path, ast.Constant) else texts.get(ast.unparse(path))
                if isinstance(route, str) and route.startswith("/"):
                    yield f"{'WebSocket' if method == 'websocket' else method.upper()} {route}"


def models_table() -> str:
    """Each table of the panel file, with the class that it becomes."""
    rows = [
        (f"[`{name}`](reference/panel-file.md#{_slug(name)})", f"`{model.__name__}`", _file_of(model))
        for name, model in models().items()
    ]
    return _markdown(rows, [("Table of the file, or kind of widget", "Class", "File"), ("---",) * 3])


def _slug(name: str) -> str:
    return "top-level" if name == ROOT else name.replace("_widget", "-widget")


def _file_of(model: type) -> str:
    return place(Path(inspect.getfile(model)))


def sentences_table() -> str:
    """Each sentence, with its code and the modules that say it."""
    rows = []
    for code in (code for code in SENTENCES if code not in BETWEEN):
        saying = [path for path, names in _said().items() if _says(names, code)]
        # A code that comes by a variable and is an ordinary word is only somewhere in the text.
        named = saying or [path for path, texts in _texts().items() if code in texts]
        rows.append((shown(SENTENCES[code]), f"`{code}`", ", ".join(map(place, named))))
    return _markdown(rows, [("Sentence", "Code", "Used in"), ("---",) * 3])


@cache
def _texts() -> dict[Path, frozenset[str]]:
    """All strings in each module."""
    return {
        path: frozenset(
            node.value
            for node in module_nodes
            if isinstance(node, ast.Constant) and isinstance(node.value, str)
        )
        for path, module_nodes in nodes().items()
    }


@cache
def _said() -> dict[Path, frozenset[str]]:
    """The codes that each module names; "finding_*" for those that it puts together."""
    return {path: frozenset(_codes(module_nodes)) for path, module_nodes in nodes().items()}


def _says(names: frozenset[str], code: str) -> bool:
    return code in names or any(name[-1] == "*" and code.startswith(name[:-1]) for name in names)


def _codes(module_nodes: Iterable[ast.AST]) -> Iterator[str]:
    for node in module_nodes:
        match node:
            case ast.Constant(value=str(code)) if "_" in code and code in SENTENCES:
                yield code
            case ast.JoinedStr(values=[ast.Constant(value=str(begin)), ast.FormattedValue(), *_]) if (
                begin.endswith("_") and any(code.startswith(begin) for code in SENTENCES)
            ):
                yield f"{begin}*"
            case ast.Call(args=arguments, keywords=keywords) if _may_say(node.func):
                for argument in (*arguments, *(word.value for word in keywords)):
                    for inner in ast.walk(argument):
                        if isinstance(inner, ast.Constant) and inner.value in SENTENCES:
                            yield str(inner.value)


def _may_say(function: ast.expr) -> bool:
    """Whether a code that is also an ordinary word is one here."""
    name = function.attr if isinstance(function, ast.Attribute) else getattr(function, "id", "")
    return name in ("say", "said", "locked", "Text", "Verdict")


def _markdown(rows: list[Any], head: list[Any]) -> str:
    return "\n".join(f"| {' | '.join(row)} |" for row in (*head, *rows))

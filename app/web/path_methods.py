"""The methods that a path has: those of its most specific template, as OpenAPI has it.

The router takes the first template that matches path and method: a post to `/diagnostics/look`, which
is only read, would be the act "look" of `/diagnostics/{act}`.
"""

import re
from collections.abc import Iterable
from typing import Final

from starlette.exceptions import HTTPException
from starlette.requests import HTTPConnection
from starlette.routing import BaseRoute, Route, compile_path

from app.web.root_path import path_of

PARAMETER: Final = re.compile(r"\{[^}]*\}")


class PathMethods:
    """The templates of an application and their methods."""

    def __init__(self) -> None:
        self._methods: dict[str, set[str]] = {}
        self._templates: list[tuple[re.Pattern[str], set[str]]] = []

    def add(self, routes: Iterable[BaseRoute], prefix: str = "") -> None:
        """Adds the routes of a router that is included below a prefix."""
        for route in routes:
            if isinstance(route, Route):
                self._methods.setdefault(prefix + route.path, set()).update(route.methods or ())
        ordered = sorted(self._methods, key=_literals, reverse=True)
        self._templates = [(compile_path(path)[0], self._methods[path]) for path in ordered]

    def of_path(self, path: str) -> set[str]:
        """Its methods; none for a path that no template matches. HEAD is there where GET is."""
        methods = next((m for pattern, m in self._templates if pattern.match(path)), set())
        return methods | {"HEAD"} if "GET" in methods else methods


def methods_of(connection: HTTPConnection) -> set[str]:
    """The methods of a request's path."""
    known: PathMethods = connection.app.state.path_methods
    return known.of_path(path_of(connection.scope))


async def method_guard(connection: HTTPConnection) -> None:
    """405 for a method that only another template has. The handler of errors names the others."""
    if connection.scope["type"] != "http":
        return
    methods = methods_of(connection)  # none of a route that was added later
    if methods and connection.scope["method"] not in methods:
        raise HTTPException(405)


def _literals(path: str) -> int:
    """How many characters of a template are no parameter."""
    return len(PARAMETER.sub("", path))

"""Results of queries of a graph that are kept until it changes."""

from collections.abc import Callable
from typing import Any, Protocol, TypeVar, TypeVarTuple


class Caching(Protocol):
    """What has results to keep; it clears them when it changes."""

    cache: dict[Any, Any]


AnyCaching = TypeVar("AnyCaching", bound=Caching)
Arguments = TypeVarTuple("Arguments")
Result = TypeVar("Result")


def cached_until_change(
    query: Callable[[AnyCaching, *Arguments], Result],
) -> Callable[[AnyCaching, *Arguments], Result]:
    """Caches the results of a query until the graph changes: queries are far more frequent."""

    def cached(graph: AnyCaching, *arguments: *Arguments) -> Result:
        key = (query, arguments)
        result: Result
        try:
            result = graph.cache[key]
        except KeyError:
            result = graph.cache[key] = query(graph, *arguments)
        return result

    cached.__doc__ = query.__doc__
    return cached

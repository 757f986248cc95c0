"""Topics that nodes publish by their absolute names in whatever namespace they are: /rosout and
/parameter_events. They are behind the namespace of a peer, if it has one."""

from collections.abc import Sequence

from app.robot.graph import LiveGraph


def present_key(graph: LiveGraph, topic: str, keys: Sequence[str]) -> str:
    """The key under which the peers have a topic, of those that it can have: that of a publisher,
    else the one behind a peer's namespace, else the first."""
    published = (key for key in keys if graph.has_endpoint("MP", key))
    behind = {f"{namespace}{topic}"[1:] for namespace in graph.namespaces}
    return next(published, None) or next((key for key in keys if key in behind), keys[0])

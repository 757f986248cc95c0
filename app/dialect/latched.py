"""The caches by which publishers that are TRANSIENT_LOCAL keep their last message for subscribers that
come late. They are zenoh-ext's, the same in every dialect (source: zenoh-ext 1.10). No I/O."""

from typing import Final

_CACHES: Final = "/@adv/pub/"


def caches(expression: str) -> str:
    """The tokens of the caches of a topic. Each answers to a query of its own name."""
    return f"{expression}{_CACHES}**"


def newest(token: str) -> str:
    """The query for the last message of a cache."""
    return f"{token}?_max=1"

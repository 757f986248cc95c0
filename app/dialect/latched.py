"""The caches in which TRANSIENT_LOCAL publishers keep their last message for late subscribers. They are
zenoh-ext's, the same in every dialect (source: zenoh-ext 1.10). No I/O."""

from typing import Final

_CACHES: Final = "/@adv/pub/"


def caches(expression: str) -> str:
    """The key expression of the tokens of a topic's caches. A cache answers queries of its token's
    name."""
    return f"{expression}{_CACHES}**"


def is_cache_of(token: str, zid: str) -> bool:
    """Whether a token is that of a cache of the session `zid`."""
    return f"{_CACHES}{zid}/" in token


def newest(token: str) -> str:
    """The query for the last message of a cache."""
    return f"{token}?_max=1"

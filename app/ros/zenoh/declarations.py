"""What a Zenoh session subscribes to, publishes and queries: keys → Zenoh key expressions."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Final

from app.ros.zenoh.inbox import NO_KEYS


@dataclass(frozen=True, slots=True, kw_only=True)
class Declarations:
    """Key → key expression of each topic that is subscribed to or published, and of each service that
    is queried. `latched` are the published ones that keep their last messages, with how many.
    `immediate`, `lossless`, `recorded` and `changing` are the keys of topics for `Inbox.set_topics`."""

    subscribe: Mapping[str, str] = field(default_factory=dict)
    publish: Mapping[str, str] = field(default_factory=dict)
    query: Mapping[str, str] = field(default_factory=dict)
    latched: Mapping[str, int] = field(default_factory=dict)
    immediate: Collection[str] = NO_KEYS
    lossless: Collection[str] = NO_KEYS
    recorded: Collection[str] = NO_KEYS
    changing: Collection[str] = NO_KEYS


NOTHING: Final = Declarations()

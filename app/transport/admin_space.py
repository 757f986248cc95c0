"""The protocols of a link by which the admin space and the ROS graph are queried."""

import json
from contextlib import suppress
from typing import Any, Protocol


class AdminSpace(Protocol):
    """The part of the Zenoh session that queries of the admin space need."""

    async def query_all(self, selector: str, timeout_s: float = ...) -> list[tuple[str, bytes]]:
        """(key, payload) of each answer that arrives in time. LinkError without a link."""


class GraphLink(AdminSpace, Protocol):
    """The part of the Zenoh session that reading the ROS graph needs."""

    async def tokens(self, timeout_s: float = ...) -> list[str]:
        """The liveliness tokens. LinkError without a link, or if not all arrive in time."""


async def ask_json(link: AdminSpace, selector: str) -> list[tuple[str, Any]]:
    """(key, answer) of each answer that is JSON; others are ignored. LinkError without a link."""
    answers = []
    for key, answer in await link.query_all(selector):
        with suppress(ValueError, RecursionError):
            answers.append((key, json.loads(answer)))
    return answers

"""The protocol of the link that commands are sent by."""

import asyncio
from typing import Protocol


class Transport(Protocol):
    """The part of the Zenoh session that commands need. Topics and services are given by their keys.
    LinkError if a message or query can't be sent."""

    def put(self, key: str, payload: bytes) -> None:
        """Publishes a message on a topic."""

    def has_reader(self, key: str) -> bool:
        """Whether the publisher of a topic has a matching subscriber."""

    def query(self, key: str, payload: bytes, timeout_s: float) -> "asyncio.Future[bytes | None]":
        """Queries a service once. The future gets the first answer, None if there is none."""

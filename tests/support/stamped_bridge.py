"""A bridge by a bare Zenoh session, whose clock is wrong and whose messages arrive in any order: what a
real one does only when something is broken."""

import json
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from datetime import UTC, datetime
from typing import Any

import zenoh
from zenoh.handlers import Callback

from app.ros.dialects import bridge_dialect
from app.ros.messages.names import Qos
from tests.support.builders import INTERFACES
from tests.support.parts import free_port


class StampedBridge:
    """Publishes messages with the time of a clock that is `ahead_s` ahead of this machine's."""

    def __init__(self, session: zenoh.Session, endpoint: str, ahead_s: float) -> None:
        self.endpoint = endpoint
        self._session = session
        self._ahead_s = ahead_s

    def publish(self, topic: str, type_name: str, data: Any, at: float) -> None:
        """A message that was sent at `at` (seconds since the epoch) by a right clock."""
        sent = datetime.fromtimestamp(at + self._ahead_s, UTC)
        stamp = zenoh.Timestamp(sent, self._session.new_timestamp().get_id())
        payload = INTERFACES.encode(type_name, {"data": data})
        self._session.put(topic.removeprefix("/"), payload, timestamp=stamp)


@contextmanager
def stamped_bridge(topics: dict[str, str], ahead_s: float = 0.0) -> Iterator[StampedBridge]:
    """A bridge with publishers of these topics, by their types."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    config = zenoh.Config()
    config.insert_json5("mode", '"peer"')
    config.insert_json5("listen/endpoints", f'["{endpoint}"]')
    config.insert_json5("scouting/multicast/enabled", "false")
    config.insert_json5("timestamping/enabled", "true")
    with zenoh.open(config) as session, ExitStack() as stack:
        zid = str(session.zid())
        values = {
            bridge_dialect.version(zid): "1.0.0",
            bridge_dialect.config(zid): json.dumps({"namespace": "/"}),
        }
        for key, text in values.items():
            answering: Any = session.declare_queryable(
                key, Callback(_answer(key, text), indirect=False), complete=True
            )
            stack.callback(answering.undeclare)
        tokens = [
            bridge_dialect.token(zid, "MP", name.removeprefix("/"), type_name, Qos(), "")
            for name, type_name in topics.items()
        ]
        for token in [*tokens, bridge_dialect.bridge_token(zid)]:
            stack.callback(session.liveliness().declare_token(token).undeclare)
        yield StampedBridge(session, endpoint, ahead_s)


def _answer(key: str, text: str) -> Any:
    def answer(query: zenoh.Query) -> None:
        with query:
            query.reply(key, text)

    return answer

"""A simulated action on Zenoh, and how services and latched topics are behind a bridge."""

import threading
from collections.abc import Callable
from typing import Any

import zenoh
from zenoh.ext import CacheConfig, declare_advanced_publisher
from zenoh.handlers import Callback

from app.errors import DecodeError
from app.interfaces import Interfaces, names
from app.simulator.goals import ActionServer

Answer = Callable[[bytes], bytes | None]


class PlayedAction:
    """One action of a robot: three services and two topics."""

    def __init__(
        self,
        session: zenoh.Session,
        key: str,
        server: ActionServer,
        interfaces: Interfaces,
        lock: threading.Lock,
    ) -> None:
        self._session = session
        self._key = key
        self._server = server
        self._interfaces = interfaces
        self._lock = lock
        self._types = interfaces.action_types(server.type)
        self._status = latched(session, names.status(key))
        self._states: list[tuple[bytes, int]] = []
        self._results: list[tuple[bytes, zenoh.Query]] = []
        self._declared = [
            served(session, names.of_action(key, "send_goal"), self._begin),
            served(session, names.of_action(key, "cancel_goal"), self._cancel),
            session.declare_queryable(
                names.of_action(key, "get_result"),
                Callback(self._on_result, indirect=False),
                complete=True,
            ),
        ]

    def step(self) -> None:
        with self._lock:
            news = self._server.feedback()
            states = self._server.states()
            ended = [(q, end) for goal, q in self._results if (end := self._server.result(goal))]
            answered = {id(query) for query, _ in ended}
            self._results = [result for result in self._results if id(result[1]) not in answered]
        for goal_id, fields in news:
            message = {"goal_id": {"uuid": goal_id}, "feedback": fields}
            payload = self._interfaces.encode(self._types.feedback_message, message)
            self._session.put(names.feedback(self._key), payload)
        if states != self._states:
            self._states = states
            self._publish_states()
        for query, (status, result) in ended:
            response = {"status": status, "result": result}
            with query:
                query.reply(
                    names.of_action(self._key, "get_result"),
                    self._interfaces.encode(self._types.get_result_response, response),
                )

    def _begin(self, payload: bytes) -> bytes | None:
        try:
            request = self._interfaces.decode(self._types.send_goal_request, payload)
        except DecodeError:
            return None
        with self._lock:
            accepted = self._server.begin(bytes(request.goal_id.uuid), request.goal)
        return self._interfaces.encode(self._types.send_goal_response, {"accepted": accepted})

    def _cancel(self, payload: bytes) -> bytes | None:
        request_type, response_type = self._interfaces.service_types(self._types.cancel_goal)
        try:
            request = self._interfaces.decode(request_type, payload)
        except DecodeError:
            return None
        with self._lock:
            code, canceled = self._server.cancel(bytes(request.goal_info.goal_id.uuid))
        goals = [{"goal_id": {"uuid": goal_id}} for goal_id in canceled]
        fields = {"return_code": code, "goals_canceling": goals}
        return self._interfaces.encode(response_type, fields)

    def _on_result(self, query: zenoh.Query) -> None:
        try:
            request = self._interfaces.decode(self._types.get_result_request, payload_of(query))
        except DecodeError:
            query.drop()
            return
        with self._lock:
            self._results.append((bytes(request.goal_id.uuid), query))

    def _publish_states(self) -> None:
        """Publishes the status of all goals. Action servers do so at each change of a goal's state."""
        known = [
            {"goal_info": {"goal_id": {"uuid": goal_id}}, "status": status}
            for goal_id, status in self._states
        ]
        self._status.put(self._interfaces.encode(self._types.status, {"status_list": known}))


def latched(session: zenoh.Session, key: str) -> Any:
    """A publisher that keeps its last message for subscribers that come late."""
    cache = CacheConfig(max_samples=1)
    return declare_advanced_publisher(session, key, cache=cache, publisher_detection=True)


def served(session: zenoh.Session, key: str, answer: Answer) -> Any:
    """A queryable that answers as a service server behind a bridge does."""

    def on_query(query: zenoh.Query) -> None:
        with query:
            response = answer(payload_of(query))
            if response is not None:
                query.reply(key, response)

    return session.declare_queryable(key, Callback(on_query, indirect=False), complete=True)


def payload_of(query: zenoh.Query) -> bytes:
    return b"" if query.payload is None else query.payload.to_bytes()

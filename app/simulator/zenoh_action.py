"""A simulated action on Zenoh."""

import threading

import zenoh

from app.errors import DecodeError
from app.interfaces import Interfaces, names
from app.simulator.goals import ActionServer
from app.simulator.zenoh_wire import Wire, payload_of


class PlayedAction:
    """One action of a robot: three services and two topics."""

    def __init__(
        self,
        wire: Wire,
        key: str,
        server: ActionServer,
        interfaces: Interfaces,
        lock: threading.Lock,
    ) -> None:
        self._wire = wire
        self._key = key
        self._server = server
        self._interfaces = interfaces
        self._lock = lock
        self._types = interfaces.action_types(server.type)
        types = self._types
        self._publish_status = wire.publisher(names.status(key), types.status, latched=True)
        self._publish_feedback = wire.publisher(names.feedback(key), types.feedback_message)
        self._states: list[tuple[bytes, int]] = []
        self._results: list[tuple[bytes, zenoh.Query]] = []
        self._result_key = names.of_action(key, "get_result")
        self._declared = [
            wire.served(names.of_action(key, "send_goal"), types.send_goal, self._begin),
            wire.served(names.of_action(key, "cancel_goal"), types.cancel_goal, self._cancel),
            wire.server(self._result_key, types.get_result, self._on_result),
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
            self._publish_feedback(self._interfaces.encode(self._types.feedback_message, message))
        if states != self._states:
            self._states = states
            self._publish_states()
        for query, (status, result) in ended:
            response = self._interfaces.encode(
                self._types.get_result_response, {"status": status, "result": result}
            )
            with query:
                self._wire.reply(query, self._result_key, self._types.get_result, response)

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
        self._publish_status(self._interfaces.encode(self._types.status, {"status_list": known}))

"""A simulated robot whose interlocks and alarms are as the proof sets them, and which counts what
arrives. The rest of it is the simulated robot of the panel."""

import threading
import time
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from app.panel.alarm import Alarm
from app.panel.condition import Condition, Interlock
from app.panel.model import Panel
from app.panel.robot_panels import panel_of
from app.panel.widgets.parameter import GET
from app.panel.widgets.publish import Step
from app.ros.messages import Interfaces, load_interfaces
from app.ros.messages.definitions import FLOAT_TYPES
from app.tools.prove.cases import ENTRY, Field, alarms_of, entry_of, judged_fields
from app.tools.simulator.known_types import Moment, plausible
from app.tools.simulator.machine import candidates, satisfies
from app.tools.simulator.panel_robot import PanelRobot
from app.tools.simulator.robot import ActionServer, SimulatedTopic
from app.tools.simulator.values import Fields, put

REPEAT_S: Final = 0.3  # between two messages of a topic that is judged
STEP_S: Final = 0.02
OK, ERROR = 0, 2  # levels of a diagnostic status
TEXT_TYPES: Final = frozenset({"string", "wstring"})
BEYOND: Final = 1.5  # of a limit: a value that raises an alarm


@dataclass
class Judged:
    """A field with the value that permits everything; `value` is what it has now."""

    conditions: Sequence[Condition]
    good: Any
    choices: Sequence[Any]
    value: Any = None


@dataclass
class ProvingRobot:
    """See `SimulatedRobot`. Stepped by the simulator's thread; the proof sets it under `lock`."""

    panel: Panel  # of this robot
    number: int = 0
    name: str = ""  # its id, where the panel has several
    lock: threading.Lock = field(default_factory=threading.Lock)
    arrived: Counter[str] = field(default_factory=Counter)  # by topic, service or action
    arrived_at: dict[str, float] = field(default_factory=dict)  # the last, in monotonic seconds

    def __post_init__(self) -> None:
        self._robot = PanelRobot(self.panel, self.number)
        self._interfaces: Interfaces = load_interfaces(self.panel.distro, self.panel.interfaces)
        types = self.panel.subscriptions()
        self._judged: dict[Field, Judged] = {}
        for key, conditions in judged_fields(self.panel, self.name).items():
            self._judged[key] = self._judge(key, types[key[0]], conditions)
        alarms = alarms_of(self.panel, self.name)
        for alarm in alarms:
            self._add_alarm(alarm, types)
        # The services by which the nodes of alarms are known to be there.
        self._of_nodes = {f"{alarm.node}/{GET[0]}": GET[1] for alarm in alarms if alarm.node}
        self._said: dict[str, Fields] = {}  # by topic, in place of what the robot publishes there
        for step in self.panel.widgets():
            if isinstance(step, Step):  # it steps from the value that is reported
                self._judged.setdefault((step.value.topic, step.value.field), Judged((), step.min, ()))
        self._types = {topic: types[topic] for topic, _ in self._judged}
        self._silent: set[str] = set()
        self._sent: dict[str, tuple[float, bytes]] = {}
        self._at = 0.0
        for judged in self._judged.values():
            judged.value = judged.good

    def _judge(self, key: Field, type_name: str, conditions: Sequence[Condition]) -> Judged:
        kind = self._interfaces.type_at(type_name, key[1]).name
        choices = [*candidates(conditions, kind)]
        good = max(choices, key=lambda value: sum(satisfies(each, value) for each in conditions))
        return Judged(conditions, good, choices)

    def _add_alarm(self, alarm: Alarm, types: Mapping[str, str]) -> None:
        """The fields by which only alarms are raised or suppressed: their good values do neither."""
        if (suppressing := alarm.suppressed_while) is not None:
            key = suppressing.topic, suppressing.field
            kind = self._interfaces.type_at(types[key[0]], key[1]).name
            self._judged.setdefault(key, Judged((), unmet_value([suppressing], kind), ()))
        for key in alarm.marked_values:
            if key not in self._judged:
                kind = self._interfaces.type_at(types[key[0]], key[1]).name
                calm = [alarm for alarm in self.panel.alarms if key in alarm.marked_values]
                self._judged[key] = Judged((), calm_value(calm, kind), ())

    # What the proof sets.

    def permit(self, chosen: Iterable[Interlock], together: Collection[str] = ()) -> None:
        """The chosen interlocks permit, and as many others as can at the same time, those of `together`
        (ids) before the rest; no alarm is raised."""
        with self.lock:
            self._silent.clear()
            for judged in self._judged.values():
                judged.value = judged.good
            for interlock in chosen:
                judged = self._judged[interlock.topic, interlock.field]
                judged.value = self._best(judged, interlock, together, met=True)
            self._sent.clear()

    def _best(
        self, judged: Judged, interlock: Interlock, together: Collection[str], *, met: bool
    ) -> Any:
        """The value that meets the interlock, or does not, and most others."""

        def rank(value: Any) -> tuple[int, int]:
            kept = [each for each in judged.conditions if satisfies(each, value)]
            named = [each for each in kept if isinstance(each, Interlock) and each.id in together]
            return len(named), len(kept)

        return max((value for value in judged.choices if satisfies(interlock, value) is met), key=rank)

    def forbid(self, interlock: Interlock, together: Collection[str] = ()) -> None:
        """Its field gets a value that does not meet it, and of the others as many as can be."""
        judged = self._judged[interlock.topic, interlock.field]
        with self.lock:
            judged.value = self._best(judged, interlock, together, met=False)
            self._sent.pop(interlock.topic, None)

    def set_alarm(self, alarm: Alarm, *, raised: bool) -> None:
        """What raises an alarm is published, or is not any more."""
        with self.lock:
            if alarm.topic_name is not None and entry_of(alarm):
                self._said[alarm.topic_name] = self._message_with(alarm, raised=raised)
                self._sent.pop(alarm.topic_name, None)
            elif alarm.source == "stale":
                self._silent ^= {str(alarm.topic)}
            elif alarm.marked_values:
                key = alarm.marked_values[0]
                judged = self._judged[key]
                judged.value = raising_value(alarm) if raised else judged.good
                self._sent.pop(key[0], None)

    def _message_with(self, alarm: Alarm, *, raised: bool) -> Fields:
        """A message with the entry of an alarm that the robot publishes itself, active or not."""
        if alarm.listed is None:
            status = {"name": entry_of(alarm), "level": ERROR if raised else OK, "message": "proof"}
            return {"status": [{**status, "hardware_id": "", "values": []}]}
        listed, type_name = alarm.listed, str(alarm.topic_type)
        kind = self._interfaces.type_at(type_name, listed.field).name
        structures = self._interfaces.structures
        entry: Fields = {}
        code = self._interfaces.type_at(kind, listed.code).name
        put(entry, kind, listed.code, ENTRY if code in TEXT_TYPES else int(ENTRY), structures)
        if listed.active is not None:
            put(entry, kind, listed.active, raised, structures)
        message: Fields = {}
        entries = [entry] if raised or listed.active is not None else []
        put(message, type_name, listed.field, entries, structures)
        return message

    def silence(self, topics: Iterable[str]) -> None:
        """These topics are not published."""
        with self.lock:
            self._silent |= {*topics}

    # `SimulatedRobot`.

    @property
    def step_s(self) -> float:
        return STEP_S

    @property
    def publishes(self) -> Mapping[str, SimulatedTopic]:
        own = self._robot.publishes
        missing = {
            topic: SimulatedTopic(
                name, self.panel.qos(topic).wire_qos, self._interfaces.type_hash(name)
            )
            for topic, name in self._types.items()
            if topic not in own
        }
        return {**own, **missing}

    @property
    def subscribes(self) -> Mapping[str, SimulatedTopic]:
        return self._robot.subscribes

    @property
    def services(self) -> Mapping[str, str]:
        return {**self._of_nodes, **self._robot.services}

    @property
    def actions(self) -> Mapping[str, ActionServer]:
        counted = self._robot.actions
        return {name: CountedAction(name, server, self.arrived) for name, server in counted.items()}

    def receive(self, topic: str, payload: bytes) -> None:
        self.arrived[topic] += 1
        self.arrived_at[topic] = time.monotonic()
        self._robot.receive(topic, payload)

    def serve(self, service: str, payload: bytes) -> bytes | None:
        self.arrived[service] += 1
        if service in self._of_nodes and service not in self._robot.services:
            return None
        return self._robot.serve(service, payload)

    def step(self, moment: Moment) -> Iterator[tuple[str, bytes]]:
        for topic, payload in self._robot.step(moment):
            if topic not in self._types and topic not in self._said and topic not in self._silent:
                yield topic, payload
        with self.lock:
            due = [*self._due(moment)]
        yield from due

    def _due(self, moment: Moment) -> Iterator[tuple[str, bytes]]:
        for topic, type_name in self._types.items():
            sent = self._sent.get(topic)
            if topic in self._silent or (sent is not None and moment.t - sent[0] < REPEAT_S):
                continue
            fields = plausible(type_name, self._interfaces)(moment)
            for (name, path), judged in self._judged.items():
                if name == topic:
                    put(fields, type_name, path, judged.value, self._interfaces.structures)
            payload = self._interfaces.encode(type_name, fields)
            self._sent[topic] = moment.t, payload
            yield topic, payload
        for topic, fields in self._said.items():
            sent = self._sent.get(topic)
            if sent is None or moment.t - sent[0] >= REPEAT_S:
                payload = self._interfaces.encode(self.publishes[topic].type, fields)
                self._sent[topic] = moment.t, payload
                yield topic, payload


class ProvingRobots:
    """The robots of a panel, of which `own` is proved: what guards its controls may be of others."""

    def __init__(self, panel: Panel, robot: str) -> None:
        """`robot` is the id of the one that is proved, "" for the only one."""
        self.names = [str(entry.id) for entry in panel.robots] or [""]
        self._robots = {
            name: ProvingRobot(panel_of(panel, name or None), number, name)
            for number, name in enumerate(self.names)
        }
        self.name = robot
        self.own = self._robots[robot]

    def __getitem__(self, name: str) -> ProvingRobot:
        return self._robots[name]

    def name_for(self, interlock: Interlock) -> str:
        """The id of the robot that publishes it."""
        return interlock.robot or self.name

    def permit(self, chosen: Iterable[Interlock], together: Collection[str] = ()) -> None:
        ordered = [*chosen]
        for name, robot in self._robots.items():
            robot.permit([each for each in ordered if self.name_for(each) == name], together)

    def forbid(self, interlock: Interlock, together: Collection[str] = ()) -> None:
        self._robots[self.name_for(interlock)].forbid(interlock, together)

    def silence(self, interlocks: Iterable[Interlock]) -> None:
        """Their topics are not published."""
        for interlock in interlocks:
            self._robots[self.name_for(interlock)].silence([interlock.topic])


class CountedAction:
    """An action that counts its goals."""

    def __init__(self, name: str, server: ActionServer, arrived: Counter[str]) -> None:
        self._name, self._server, self._arrived = name, server, arrived

    @property
    def type(self) -> str:
        return self._server.type

    def begin(self, goal_id: bytes, goal: Any) -> bool:
        self._arrived[self._name] += 1
        return self._server.begin(goal_id, goal)

    def cancel(self, goal_id: bytes) -> tuple[int, list[bytes]]:
        return self._server.cancel(goal_id)

    def feedback(self) -> list[tuple[bytes, Any]]:
        return self._server.feedback()

    def states(self) -> list[tuple[bytes, int]]:
        return self._server.states()

    def result(self, goal_id: bytes) -> tuple[int, Any] | None:
        return self._server.result(goal_id)


def unmet_value(conditions: Sequence[Condition], kind: str) -> Any:
    """A value that meets as few of the conditions of a field as can be."""
    choices = [*candidates(conditions, kind)]
    return min(choices, key=lambda value: sum(satisfies(each, value) for each in conditions))


def calm_value(alarms: Sequence[Alarm], kind: str) -> Any:
    """A value that raises none of the alarms of a field."""
    if conditions := [alarm.when for alarm in alarms if alarm.when is not None]:
        return unmet_value(conditions, kind)
    lows = [limit for alarm in alarms for limit in (alarm.low, alarm.low_low) if limit is not None]
    highs = [limit for alarm in alarms for limit in (alarm.high, alarm.high_high) if limit is not None]
    low = max(lows) if lows else min(highs) - 2 * max(1.0, abs(min(highs)))
    high = min(highs) if highs else max(lows) + 2 * max(1.0, abs(max(lows)))
    return _as_field((low + high) / 2, alarms[0], kind)


def raising_value(alarm: Alarm) -> Any:
    """A value that raises an alarm."""
    if alarm.when is not None:
        kind = "bool" if not alarm.when.comparisons else ""
        return next(value for value in candidates([alarm.when], kind) if satisfies(alarm.when, value))
    limits = alarm.limits
    below = [limits[name] for name in ("low", "low_low") if name in limits]
    if below:
        value = min(below) - BEYOND * max(1.0, abs(alarm.deadband))
    else:
        value = max(limits.values()) + BEYOND * max(1.0, abs(alarm.deadband))
    return _as_field(value, alarm, "float64")


def _as_field(value: float, alarm: Alarm, kind: str) -> Any:
    """What the field has where this is shown."""
    own = (value - alarm.offset) / alarm.scale
    return own if kind in FLOAT_TYPES else round(own)

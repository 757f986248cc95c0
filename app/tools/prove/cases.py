"""What is proved of a panel: each control in each situation of its interlocks, each alarm, and each way
to end a hold. Pure, and from the panel file alone: it shares no code with what decides."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from typing import Final, Literal, NamedTuple

from app.panel.alarm import Alarm
from app.panel.condition import Condition, Interlock
from app.panel.model import Panel, RobotEntry
from app.panel.roles import MAINTENANCE, ROLES, VIEWER
from app.panel.widgets.families import Command
from app.panel.widgets.hold import HoldCommand
from app.panel.widgets.key_parts import Confirmation, confirmation_of
from app.system.texts.text import each_language

Situation = Literal[
    "permits", "forbids", "never_seen", "old", "other_type", "publisher_gone", "robot_lost",
    "link_cut", "no_control", "no_role", "shutdown",
    "role_enough", "role_less", "unconfirmed", "wrong_pin", "same_person",
]  # fmt: skip
# Those of one interlock, in the order in which they are made.
OF_INTERLOCK: Final[Sequence[Situation]] = (
    "never_seen", "permits", "forbids", "old", "other_type", "publisher_gone", "robot_lost",
)  # fmt: skip
# Those in which a confirmation by a person is wrong; the last one where it takes two.
WRONGLY_CONFIRMED: Final[Sequence[Situation]] = ("unconfirmed", "wrong_pin", "same_person")
MOST_WAITED_S: Final = 30.0  # for an alarm, unless the proof is patient
ENTRY: Final = "1"  # the code of an alarm that is an entry of a list: also a number
HoldEnd = Literal["released", "page_gone", "no_beat", "forbids", "link_cut"]
HOLD_ENDS: Final[Sequence[HoldEnd]] = ("released", "page_gone", "no_beat", "forbids")
Field = tuple[str, str]  # topic, path


class Persona(NamedTuple):
    """A user of the proof by the role and the groups of the panel."""

    role: str
    groups: frozenset[str] = frozenset()


class Case(NamedTuple):
    """A control in a situation of the interlock `guard`, "" for a situation of the whole panel."""

    control: str
    guard: str
    situation: Situation


class HoldCase(NamedTuple):
    """A hold that ends in a way; `guard` is the interlock that forbids, else ""."""

    control: str
    end: HoldEnd
    guard: str = ""


@dataclass(frozen=True)
class Guarded:
    """A control with the ids of the interlocks that guard it, and the roles and groups that a press
    needs."""

    control: Command
    guards: frozenset[str]
    needs: frozenset[str] = frozenset()

    @property
    def confirmation(self) -> Confirmation:
        """By whom a press is confirmed, "" for no one."""
        return confirmation_of(self.control)

    @property
    def enough(self) -> Persona:
        """The user with the least that may press it."""
        needed = [role for role in ROLES if role in self.needs] or [VIEWER]
        return Persona(needed[-1], self.needs - {*ROLES})

    @property
    def less(self) -> Persona | None:
        """The user with the most that lacks something; None if everyone may press it."""
        if self.needs - {*ROLES}:
            return Persona(MAINTENANCE)
        below = ROLES.index(self.enough.role) - 1
        return Persona(ROLES[below]) if below >= 0 else None


@dataclass(frozen=True)
class Plan:
    """What is proved. `rounds` are interlocks that can be examined at the same time: no control has two
    of a round, and no two of a round are read from one field."""

    robot: str  # its id, "" for the only one
    controls: Mapping[str, Guarded]
    interlocks: Mapping[str, Interlock]  # also those of other robots that guard a control
    rounds: Sequence[Sequence[Interlock]]
    alarms: Sequence[Alarm]
    left_out: Mapping[str, str]  # control or alarm → why it is not proved

    @property
    def confirmed(self) -> Sequence[Guarded]:
        """The controls whose press a person confirms."""
        return [guarded for guarded in self.controls.values() if guarded.confirmation]

    @property
    def has_confirmations(self) -> bool:
        """Whether a person confirms a press or an act on an alarm."""
        return bool(self.confirmed) or any(alarm.confirm_act for alarm in self.alarms)

    @property
    def personas(self) -> Sequence[Persona]:
        """The users who are needed to try the roles of all controls."""
        users = [user for guarded in self.controls.values() for user in (guarded.enough, guarded.less)]
        return list(dict.fromkeys(user for user in users if user is not None))

    def cases(self) -> Iterator[Case]:
        """Each case of a control, once."""
        for guarded in self.controls.values():
            name = str(guarded.control.id)
            for guard in sorted(guarded.guards):
                for situation in situations(self.interlocks[guard], self.robot):
                    yield Case(name, guard, situation)
            if not guarded.guards:
                yield Case(name, "", "permits")

    def holds(self) -> Iterator[HoldCase]:
        for guarded in self.controls.values():
            if isinstance(guarded.control, HoldCommand):
                for end in HOLD_ENDS:
                    if end != "forbids":
                        yield HoldCase(str(guarded.control.id), end)
                for guard in sorted(guarded.guards):
                    yield HoldCase(str(guarded.control.id), "forbids", guard)


def situations(interlock: Interlock, robot: str) -> Iterator[Situation]:
    """The situations that an interlock can be in, for the controls of a robot."""
    for situation in OF_INTERLOCK:
        if situation == "old" and interlock.max_age_s is None:
            continue
        if situation == "publisher_gone" and not interlock.require_publisher:
            continue
        if situation == "robot_lost" and interlock.robot in (None, robot):
            continue
        yield situation


def wrong_confirmations(confirmation: Confirmation) -> Sequence[Situation]:
    """The situations in which a confirmation is wrong."""
    return WRONGLY_CONFIRMED if confirmation == "two_persons" else WRONGLY_CONFIRMED[:-1]


def plan_of(panel: Panel, robot: str = "", longest_s: float = MOST_WAITED_S) -> Plan:
    """The plan for the robot without a name, or for the `robot` (its id) whose panel this is
    (`panel_of`). Alarms that take longer than `longest_s` are left out."""
    interlocks = {each.id: each for each in panel.every_interlock}
    left_out: dict[str, str] = {}
    controls: dict[str, Guarded] = {}
    for widget in panel.commands:
        guards = frozenset(widget.interlocks)
        needs = panel.needs.commands.get(widget.id, frozenset())
        controls[str(widget.id)] = Guarded(widget, guards, needs)
    used = {guard for guarded in controls.values() for guard in guarded.guards}
    alarms = []
    for alarm in alarms_of(panel, robot):
        if why := why_not_provable(alarm, panel, longest_s):
            left_out[f"alarm {alarm.id}"] = why
        else:
            alarms.append(alarm)
    chosen = [each for name, each in interlocks.items() if name in used]
    return Plan(robot, controls, interlocks, rounds(chosen, controls), tuple(alarms), left_out)


def alarm_key(name: str, robot: str) -> str:
    """The id of an alarm at the server; `robot` is the id of one of several."""
    return f"{name}@{robot}" if robot else name


def alarms_of(panel: Panel, robot: str) -> Sequence[Alarm]:
    """The alarms of the only robot (""), or of one of several."""
    return [alarm for alarm in panel.alarms if alarm.is_for(robot or None)]


def why_not_provable(alarm: Alarm, panel: Panel, longest_s: float) -> str:
    """Why an alarm can't be raised on the simulated robot; "" if it can."""
    waits_s = alarm.on_delay_s + alarm.off_delay_s + (alarm.stale_s or 0.0)
    if waits_s > longest_s:
        return f"it takes {waits_s:g} s, and the proof waits for {longest_s:g} s at most (--patient)"
    judged = {interlock.topic for interlock in panel.every_interlock}
    if alarm.suppressed_while is not None and alarm.suppressed_while.topic in judged:
        return "what suppresses it is an interlock's topic too"
    if alarm.source in ("diagnostics", "list"):
        if alarm.topic_name in judged:
            return "its topic is an interlock's too"
        if not entry_of(alarm):
            return "no name fits its patterns"
    return ""


def entry_of(alarm: Alarm) -> str:
    """The name of an entry that raises an alarm which the robot publishes itself; "" if there is none,
    and for other alarms."""
    if alarm.listed is not None:
        return ENTRY
    for pattern in alarm.diagnostics or ():
        name = pattern.replace("*", ENTRY)
        if fnmatchcase(name, pattern):
            return name
    return ""


def rounds(
    interlocks: Sequence[Interlock], controls: Mapping[str, Guarded]
) -> Sequence[Sequence[Interlock]]:
    """The interlocks in as few rounds as a greedy choice finds."""
    made: list[list[Interlock]] = []
    for interlock in interlocks:
        for chosen in made:
            if not any(_conflict(interlock, other, controls) for other in chosen):
                chosen.append(interlock)
                break
        else:
            made.append([interlock])
    return made


def _conflict(interlock: Interlock, other: Interlock, controls: Mapping[str, Guarded]) -> bool:
    if (interlock.robot, interlock.topic) == (other.robot, other.topic):
        return True
    return any({interlock.id, other.id} <= guarded.guards for guarded in controls.values())


def judged_fields(panel: Panel, robot: str) -> Mapping[Field, Sequence[Condition]]:
    """The fields of a robot that interlocks and conditions judge, with these."""
    judged: dict[Field, list[Condition]] = {}
    for condition in panel.named_conditions:
        if condition.robot in (None, robot):
            judged.setdefault((condition.topic, condition.field), []).append(condition)
    return judged


def names_interlock(reasons: str, interlock: Interlock) -> bool:
    """Whether a reason that the page shows is about this interlock: its name, its topic, or its own
    sentence."""
    said = [*each_language(interlock.name).values(), *each_language(interlock.subject).values()]
    if interlock.own_sentence is not None:
        said += [
            text.partition("{value}")[0] for text in each_language(interlock.own_sentence).values()
        ]
    return any(text and text in reasons for text in (*said, interlock.topic))


def names_robot(reasons: str, robot: RobotEntry) -> bool:
    """Whether a reason that the page shows is about this robot."""
    return any(name in reasons for name in each_language(robot.name).values())

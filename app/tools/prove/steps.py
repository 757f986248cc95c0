"""The steps of a live proof: the cases of a plan, each step with what to do at the machine and what the
panel must show then. Pure."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

from app.panel.condition import Condition, Interlock
from app.panel.model import Panel
from app.panel.widgets.hold import HoldCommand
from app.panel.widgets.templated import is_stop
from app.ros.messages.validation import format_value
from app.system.texts import render
from app.tools.prove.cases import HOLD_ENDS, Guarded, Plan, Situation, alarms_of, situations

OTHER_TYPES: Final = ("std_msgs/msg/Int8", "std_msgs/msg/Float64")  # one of them differs
AT_THE_END: Final = "the server's last moments are too short to watch: proved on the simulated robot"
# In the order in which they are made at a machine: what needs a restart is last.
AT_MACHINE: Final[Sequence[Situation]] = (
    "permits", "forbids", "old", "publisher_gone", "other_type", "robot_lost", "never_seen",
)  # fmt: skip
HOW_ENDED: Final[Mapping[str, str]] = {
    "released": "release it",
    "page_gone": "close the page or its browser with the finger on it",
    "no_beat": "unplug the network cable between this screen and the panel's server",
    "forbids": "bring about, with the finger on it, that {0} does not permit",
}


class Row(NamedTuple):
    """A case of a step: see `Result`."""

    kind: str
    name: str
    guard: str
    situation: str


@dataclass(frozen=True)
class Step:
    """A step: `key` names it for as long as the panel file is the same. `do` and `must` are sentences
    for the person who watches."""

    key: str
    title: str
    do: str
    must: str
    rows: Sequence[Row]


def steps_of(panel: Panel, plan: Plan, *, has_users: bool) -> Iterator[Step]:
    """The steps of a panel's plan; `has_users`: its clients have roles."""
    for name in (each for chosen in plan.rounds for each in chosen):
        own = [guarded for guarded in plan.controls.values() if name.id in guarded.guards]
        possible = {*situations(name, plan.robot)}
        for situation in AT_MACHINE:
            if situation in possible:
                yield _of_interlock(name, situation, own)
    for guarded in plan.controls.values():
        if isinstance(guarded.control, HoldCommand):
            yield from _of_hold(guarded, plan)
        else:
            yield _of_press(guarded)
    for alarm in alarms_of(panel, plan.robot):
        acknowledged = "" if alarm.ack == "none" else " Acknowledge it at the panel."
        yield Step(
            f"alarm/{alarm.id}",
            f'alarm {alarm.id} ("{render(alarm.text or alarm.id)}")',
            f"Bring about what raises it.{acknowledged} Then bring about that it is over.",
            "The alarm is raised, shown in the line of alarms, acknowledged, and returns.",
            [Row("alarm", str(alarm.id), "", "raised")],
        )
    yield from _of_panel(panel, plan, has_users=has_users)


def _of_interlock(interlock: Interlock, situation: Situation, own: Sequence[Guarded]) -> Step:
    name, topic = render(interlock.name), interlock.topic
    restored = f'First bring about that "{name}" permits'
    other = next(kind for kind in OTHER_TYPES if kind != interlock.type)
    do = {
        "permits": f'Bring about that "{name}" permits ({met_text(interlock)}), and that all other'
        " interlocks of these controls do.",
        "forbids": f"{restored}. Then bring about that it does not (not {met_text(interlock)}).",
        "old": f"{restored}. Then stop the messages of {topic}, but not the node that publishes it"
        f" (kill -STOP), for more than {interlock.max_age_s or 0:g} s.",
        "publisher_gone": f"{restored}. Then end the node that publishes {topic}.",
        "other_type": f"{restored}. Then end the node that publishes {topic}, and publish the topic"
        f" with another type: ros2 topic pub {topic} {other}.",
        "robot_lost": f"{restored}. Then unplug the network cable of the robot {interlock.robot}.",
        "never_seen": f"{restored}. Then end the node that publishes {topic}, and restart the panel's"
        " server.",
    }[situation]
    must = f'Each is locked, with a reason that names "{name}".'
    if situation == "robot_lost":
        must = "Each is locked, with a reason that names the robot."
    return Step(
        f"interlock/{interlock.id}/{situation}",
        f"interlock {interlock.id}, {situation}",
        do,
        "Each is free." if situation == "permits" else must,
        [Row("control", str(each.control.id), interlock.id, situation) for each in own],
    )


def _of_press(guarded: Guarded) -> Step:
    control = guarded.control
    return Step(
        f"press/{control.id}",
        f'control {control.id} ("{render(control.label)}"), press',
        "Bring about that it is free, make sure that no one is in danger, and press it at the panel.",
        "The machine does it, and the panel says so.",
        [Row("control", str(control.id), "", "permits")],
    )


def _of_hold(guarded: Guarded, plan: Plan) -> Iterator[Step]:
    control = guarded.control
    for end in HOLD_ENDS:
        for guard in sorted(guarded.guards) if end == "forbids" else ("",):
            named = f'"{render(plan.interlocks[guard].name)}"' if guard else ""
            how = HOW_ENDED[end].format(named)
            yield Step(
                f"hold/{control.id}/{end}/{guard}",
                f'hold {control.id} ("{render(control.label)}"), {end}'
                + (f" by {guard}" if guard else ""),
                "Bring about that it is free, make sure that no one is in danger, and hold it at the"
                f" panel. Then {how}.",
                "The machine stops at once.",
                [Row("hold", str(control.id), guard, end)],
            )


def _of_panel(panel: Panel, plan: Plan, *, has_users: bool) -> Iterator[Step]:
    controls = [guarded.control for guarded in plan.controls.values()]
    if not controls:
        return
    others = [control for control in controls if not is_stop(control)]
    if panel.control.required and others:
        yield Step(
            "panel/no_control",
            "another page has control",
            "Take control at the panel, and open the panel in a second browser.",
            "The second browser shows each of these controls as locked.",
            [Row("control", str(control.id), "", "no_control") for control in others],
        )
    if has_users and others:
        yield Step(
            "panel/no_role",
            "without a role",
            "Sign out at the panel.",
            "Each of these controls is locked, or is not shown.",
            [Row("control", str(control.id), "", "no_role") for control in others],
        )
    yield Step(
        "panel/link_cut",
        "the link to the robot is cut",
        "Unplug the network cable between the panel's server and the robot, and wait some seconds.",
        "Each control is locked, and the panel says that the link is lost.",
        [Row("control", str(control.id), "", "link_cut") for control in controls],
    )


def met_text(condition: Condition) -> str:
    """The values that meet a condition."""
    field = f"{condition.topic}, {condition.field}"
    if not condition.written:
        return f"{field} is true"
    return f"{field}: " + ", ".join(f"{key} {format_value(v)}" for key, v in condition.written.items())

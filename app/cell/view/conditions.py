"""What check lists, sequences and the state of the machine show: pure, from (widget, robot, time)."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import repeat
from typing import Any, Final, Literal, NamedTuple

from app.cell.permission.interlocks import BY_VALUE, link_verdict, state_of
from app.cell.robot.alarmed import AlarmAction
from app.cell.robot.state import RobotState
from app.cell.view.displays import (
    LAMP_WORDS,
    NOTHING,
    SHAPES,
    FieldState,
    field_state,
    lamp_of,
    shown_value,
)
from app.cell.view.times import span_text
from app.panel.condition import NamedCondition
from app.panel.rules import MAX_DETAILS, MachineState, StateDetail
from app.panel.values import same_value
from app.panel.widgets.displays import Conditions
from app.panel.widgets.sequence import ALARM_LINES, RecoveryStep
from app.panel.widgets.sequence import Sequence as SequenceWidget
from app.system.texts import PanelText, TextLike, say
from app.system.texts.text import changed, each_language

Met = Literal["met", "unmet", "unknown"]
ORDER: Final[Sequence[Met]] = ("unmet", "unknown", "met")
MET_WORDS: Final[Mapping[Met, str]] = {
    "met": "condition_met",
    "unmet": "condition_unmet",
    "unknown": "condition_unknown",
}


class ConditionRow(NamedTuple):
    """One condition at one moment; `until` (monotonic seconds) is when time alone changes it."""

    label: TextLike
    met: Met
    value: TextLike
    need: TextLike
    until: float


def condition_row(condition: NamedCondition, robot: RobotState, now: float) -> ConditionRow:
    """An interlock or another condition. Only a value that was received makes it "unmet": without
    one, it is not known whether it is met."""
    publishing = robot.named(condition.robot)
    if publishing is None:
        return ConditionRow(condition.name, "unknown", say("condition_unknown"), "", math.inf)
    link = link_verdict(publishing, now)
    state = state_of(condition, publishing, now, link)
    verdict = state.verdict
    met: Met = "met" if verdict.permitted else "unmet" if verdict.code in BY_VALUE else "unknown"
    is_plain = not condition.comparisons or met == "unknown" or state.value == ""
    value = say(MET_WORDS[met]) if is_plain else state.value
    need: TextLike = say("condition_needs", need=state.need) if condition.comparisons else ""
    return ConditionRow(condition.name, met, value, need, min(verdict.until, link.until))


def _advising_row(condition: NamedCondition, robot: RobotState, now: float) -> ConditionRow:
    """The same where what to do counts more than what is needed."""
    row = condition_row(condition, robot, now)
    is_advised = row.met == "unmet" and condition.action is not None
    return row._replace(need=condition.action or "") if is_advised else row


def conditions(widget: Conditions, robot: RobotState, now: float) -> tuple[dict[str, Any], float]:
    """Attributes of a check list, and when they change: `shape` is "met", "unmet" or "unknown", `text`
    the line above; `row_labels`, `row_states`, `row_values` and `row_needs` have an element for each
    condition, and `order` the places of all, those that are not met first."""
    rows = [_advising_row(robot.conditions[name], robot, now) for name in widget.conditions]
    states = [row.met for row in rows]
    number = sum(state != "met" for state in states)
    summary = say("conditions_unmet", number=number, total=len(rows))
    shown = {
        "state": "live",
        "shape": next(state for state in ORDER if state in states),
        "text": summary if number else say("conditions_met"),
        "row_labels": [row.label for row in rows],
        "row_states": states,
        "row_values": [row.value for row in rows],
        "row_needs": [row.need for row in rows],
        "order": sorted(range(len(rows)), key=lambda place: ORDER.index(states[place])),
    }
    return shown, min((row.until for row in rows), default=math.inf)


StepState = Literal["done", "now", "next", "past"]
States = tuple[StepState, ...]
WORDS: Final[Mapping[StepState, str]] = {
    "done": "sequence_done",
    "now": "sequence_now",
    "next": "sequence_next",
    "past": "sequence_past",
}
DONE: Final[StepState] = "done"
NEXT: Final[StepState] = "next"
NO_FAULT: Final = FieldState("live", "")


class Steps(NamedTuple):
    """Steps with the state of each. A step without a condition is "past", not "done", where a later one
    is done: no one has said that it was made."""

    steps: tuple[RecoveryStep, ...]
    texts: tuple[TextLike, ...]
    states: States


def sequence(widget: SequenceWidget, robot: RobotState, now: float) -> tuple[dict[str, Any], float]:
    """Attributes of a sequence, and when they change.

    `state` and `note` are those of a display; `mode` is "recovery" under a fault, else "usual";
    `title` and `text` stand above the steps. `rows` are the steps that are shown, each with `number`,
    `text`, `note`, `state` and `word`, which is the state for those who do not see it. `picture` is the
    name of a picture, `mark` a place in it in percent, `[]` for none, and `at` the number there.
    """
    rows = {name: condition_row(robot.conditions[name], robot, now) for name in widget.named_conditions}
    met: dict[str, Met] = {name: row.met for name, row in rows.items()}
    until = min((row.until for row in rows.values()), default=math.inf)
    faults = [met[name] for name in widget.fault_conditions]
    alarm = next((a for a in robot.alarm_actions if a.alarm in widget.alarms and a.action), None)
    if "unmet" in faults or alarm is not None:
        steps = _recovery(widget, robot, met, alarm, has_fault="unmet" in faults)
        picture = alarm.picture if alarm else ""
        return _shown(widget, steps, NO_FAULT, "recovery", picture), until
    field, steps = _usual(widget, robot, met, now)
    if "unknown" in faults:
        field = FieldState("waiting", say("sequence_fault_unknown"))
    return _shown(widget, steps, field, "usual"), min(until, field.until)


def _usual(
    widget: SequenceWidget, robot: RobotState, met: dict[str, Met], now: float
) -> tuple[FieldState, Steps]:
    """The steps by the field that says which is under way, else by their conditions."""
    texts = tuple(_text(step, robot) for step in widget.steps)
    if widget.current is None:
        return NO_FAULT, Steps(widget.steps, texts, _by_conditions(widget.steps, met))
    field = field_state(widget.current, robot, now)
    count = len(widget.steps)
    at = next((n for n, value in enumerate(widget.values) if same_value(value, field.value)), None)
    if field.value is not None and at is None:
        note = say("sequence_step_unknown", value=shown_value(field.value, robot.texts))
        field = replace(field, state="missing" if field.state == "live" else field.state, note=note)
    states: States = tuple(repeat(NEXT, count))
    if at is not None:
        states = (*repeat(DONE, at), "now", *repeat(NEXT, count - at - 1))
    return field, Steps(widget.steps, texts, states)


def _recovery(
    widget: SequenceWidget,
    robot: RobotState,
    met: dict[str, Met],
    alarm: AlarmAction | None,
    *,
    has_fault: bool,
) -> Steps:
    """What to do about an alarm, line by line, then the steps of the way out of the fault."""
    lines = tuple(_lines(alarm.action)) if alarm else ()
    own = widget.recovery if has_fault else ()
    steps = (*(RecoveryStep() for _ in lines), *own)
    texts = (*lines, *(_text(step, robot) for step in own))
    return Steps(steps, texts, _by_conditions(steps, met))


def _lines(action: TextLike) -> Iterator[TextLike]:
    """The lines of a text, in each language; the last one has all that are left."""
    if not isinstance(action, str | PanelText):
        yield action
        return
    count = max(len(text.splitlines()) for text in each_language(action).values())
    for number in range(min(count, ALARM_LINES)):
        yield changed(action, partial(_line, number=number))


def _line(text: str, number: int) -> str:
    lines = text.splitlines()
    end = len(lines) if number == ALARM_LINES - 1 else number + 1
    return " ".join(lines[number:end])


def _text(step: RecoveryStep, robot: RobotState) -> TextLike:
    """Its own text, or what its condition says that the operator does."""
    if step.text is not None or step.condition is None:
        return step.text or ""
    return robot.conditions[step.condition].action or ""


def _by_conditions(steps: tuple[RecoveryStep, ...], met: dict[str, Met]) -> States:
    """A step with a condition is done while that is met. The first that is not done is under way, with
    those right before it that have no condition."""
    conditions = [step.condition for step in steps]
    if not any(conditions):
        return tuple(repeat(NEXT, len(steps)))
    is_done = [name is not None and met[name] == "met" for name in conditions]
    last_done = max((n for n, done in enumerate(is_done) if done), default=-1)
    first = next((n for n, name in enumerate(conditions) if name and not is_done[n]), len(steps))

    def state(number: int) -> StepState:
        if is_done[number]:
            return "done"
        if number == first:
            return "now"
        between = conditions[number:first] if number < first else ["later"]
        if not any(between):
            return "now"
        return "past" if number < last_done else "next"

    return tuple(state(number) for number in range(len(steps)))


def _shown(
    widget: SequenceWidget, steps: Steps, field: FieldState, mode: str, picture: str = ""
) -> dict[str, Any]:
    states = steps.states
    at = next((number for number, state in enumerate(states) if state == "now"), None)
    window = _window(len(states), widget.rows_at_most, at, states.count("done"))
    text: TextLike = ""
    if at is not None:
        text = say("sequence_step", number=at + 1, total=len(states))
    elif states and states.count("done") == len(states):
        text = say("sequence_all_done")
    now = [step for step, state in zip(steps.steps, states, strict=True) if state == "now"]
    marked = next(
        (number for number, step in enumerate(steps.steps) if step in now and step.mark), None
    )
    mark = steps.steps[marked].mark if marked is not None else None
    own = next((step.picture for step in now if step.picture), None)
    return {
        "state": field.state,
        "note": field.note if field.state != "live" else "",
        "mode": mode,
        "title": say("sequence_recovery") if mode == "recovery" else widget.label,
        "text": text,
        "rows": [
            {
                "number": str(number + 1),
                "text": steps.texts[number],
                "note": steps.steps[number].note or "",
                "state": states[number],
                "word": say(WORDS[states[number]]),
            }
            for number in window
        ],
        "picture": own or picture or widget.picture or "",
        "mark": list(mark) if mark else [],
        "at": "" if marked is None else str(marked + 1),
    }


def _window(count: int, rows: int, at: int | None, done: int) -> range:
    """The steps that are shown: the one under way is the second of them, if not all have room."""
    first = done - rows + 1 if at is None else at - 1
    first = max(0, min(first, count - rows))
    return range(first, min(count, first + rows))


# What the machine is doing, as the frame shows it: pure, from (display, robot, time).

MINUTE_S: Final = 60.0


def machine_state(display: MachineState, robot: RobotState, now: float) -> tuple[dict[str, Any], float]:
    """Attributes of the machine's state: those of a lamp, `since` (how long it has been so, "" where
    that was not heard), `why` (what asks for the story of a stop, "" while it has not stopped) and
    `detail0`, `detail1`; and when time alone changes them.

    A state that is not known now has a shape and a word of its own, and never a colour. An active alarm
    with a `state` replaces what the robot says.
    """
    details, changes = _details(display, robot, now)
    age_s = state_s(display, robot, now)
    since, until = ("", math.inf) if age_s is None else _for_s(age_s, now)
    if (alarmed := robot.alarmed.state) is not None:
        text, shape, colour = lamp_of(display.states, alarmed.value)
        shown = {"state": "live", "text": text, "shape": shape, "colour": colour, "note": ""}
        why = _why(display, alarmed.value)
        return {**shown, "since": since, "why": why, **details}, min(until, changes)
    field = field_state(display, robot, now)
    text, shape, colour = lamp_of(display.states, field.value, robot.texts)
    if field.state != "live":
        text, shape, colour = say(LAMP_WORDS[field.state]), SHAPES[field.state], "none"
        since, until = "", math.inf
    shown = {"state": field.state, "text": text, "shape": shape, "colour": colour, "note": field.note}
    why = _why(display, field.value if field.state == "live" else None)
    return {**shown, "since": since, "why": why, **details}, min(field.until, until, changes)


def _why(display: MachineState, value: Any) -> TextLike:
    """What asks for the story of a stop; "" for a state that is none."""
    return say("story_title") if any(same_value(value, stop) for stop in display.stops) else ""


def state_s(display: MachineState, robot: RobotState, now: float) -> float | None:
    """For how many seconds the machine has been in its state; None where that was not heard."""
    if robot.alarmed.state is not None:
        return now - robot.alarmed.state.since
    reading = robot.reading(display.topic)
    changed = reading.since.get(display.field)
    if changed is None:
        return None
    return max(0.0, reading.wall - changed) + max(0.0, now - reading.at)


def _for_s(age: float, now: float) -> tuple[TextLike, float]:
    """For how long the state has been so, and when that text changes."""
    step = 1.0 if age < MINUTE_S else MINUTE_S
    return say("machine_state_for", duration=span_text(age)), now + step - age % step


def _details(display: MachineState, robot: RobotState, now: float) -> tuple[dict[str, Any], float]:
    """Attribute → text of each detail, "" for those that the panel lacks."""
    texts: dict[str, Any] = {f"detail{number}": "" for number in range(MAX_DETAILS)}
    until = math.inf
    for number, detail in enumerate(display.details):
        texts[f"detail{number}"], changes = _detail(detail, robot, now)
        until = min(until, changes)
    return texts, until


def _detail(detail: StateDetail, robot: RobotState, now: float) -> tuple[TextLike, float]:
    """The label and the value; a dash in place of a value that is not known now."""
    field = field_state(detail, robot, now)
    value: TextLike = NOTHING
    if field.state == "live":
        own = shown_value(field.value, robot.texts)
        value = detail.words.get(str(shown_value(field.value)), own)
    if not detail.label:
        return value, field.until
    return say("machine_state_detail", label=detail.label, value=value), field.until

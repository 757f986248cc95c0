"""What a sequence of steps shows: pure, from (widget, robot, time)."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial
from itertools import repeat
from typing import Any, Final, Literal, NamedTuple

from app.i18n import PanelText, TextLike, say
from app.i18n.values import changed, each_language
from app.panel.values import same_value
from app.panel.widgets.sequence import ALARM_LINES, RecoveryStep, Sequence
from app.robot.alarm_action import AlarmAction
from app.robot.state import RobotState
from app.view.condition_values import Met, condition_row
from app.view.display_values import FieldState, field_state, shown_value

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


def sequence(widget: Sequence, robot: RobotState, now: float) -> tuple[dict[str, Any], float]:
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
    widget: Sequence, robot: RobotState, met: dict[str, Met], now: float
) -> tuple[FieldState, Steps]:
    """The steps by the field that says which is under way, else by their conditions."""
    texts = tuple(_text(step, robot) for step in widget.steps)
    if widget.current is None:
        return NO_FAULT, Steps(widget.steps, texts, _by_conditions(widget.steps, met))
    field = field_state(widget.current, robot, now)
    count = len(widget.steps)
    at = next((n for n, value in enumerate(widget.values) if same_value(value, field.value)), None)
    if field.value is not None and at is None:
        note = say("sequence_step_unknown", value=shown_value(field.value))
        field = replace(field, state="missing" if field.state == "live" else field.state, note=note)
    states: States = tuple(repeat(NEXT, count))
    if at is not None:
        states = (*repeat(DONE, at), "now", *repeat(NEXT, count - at - 1))
    return field, Steps(widget.steps, texts, states)


def _recovery(
    widget: Sequence,
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
    widget: Sequence, steps: Steps, field: FieldState, mode: str, picture: str = ""
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

"""What a check list of conditions shows: pure, from (widget, robot, time)."""

import math
from collections.abc import Sequence
from typing import Any, Final, Literal, NamedTuple

from app.i18n import TextLike, say
from app.panel.condition import NamedCondition
from app.panel.widgets.conditions import Conditions
from app.permission.interlocks import BY_VALUE, link_verdict, state_of
from app.robot.state import RobotState

Met = Literal["met", "unmet", "unknown"]
ORDER: Final[Sequence[Met]] = ("unmet", "unknown", "met")


class Row(NamedTuple):
    """One condition at one moment; `until` (monotonic seconds) is when time alone changes it."""

    label: TextLike
    met: Met
    value: TextLike
    need: TextLike
    until: float


def condition_row(condition: NamedCondition, robot: RobotState, now: float) -> Row:
    """An interlock or another condition. Only a value that was received makes it "unmet": without
    one, it is not known whether it is met."""
    publishing = robot.named(condition.robot)
    if publishing is None:
        return Row(condition.name, "unknown", say("condition_unknown"), "", math.inf)
    link = link_verdict(publishing, now)
    state = state_of(condition, publishing, now, link)
    verdict = state.verdict
    met: Met = "met" if verdict.permitted else "unmet" if verdict.code in BY_VALUE else "unknown"
    is_plain = not condition.comparisons or met == "unknown" or state.value == ""
    value = say(f"condition_{met}") if is_plain else state.value
    need: TextLike = say("condition_needs", need=state.need) if condition.comparisons else ""
    return Row(condition.name, met, value, need, min(verdict.until, link.until))


def _advising_row(condition: NamedCondition, robot: RobotState, now: float) -> Row:
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

"""Why a control is locked now, and what to do: pure, from (widget, robot, time, the server's locks)."""

from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

from app.cell.permission.interlocks import interlock_verdict, link_verdict
from app.cell.permission.press_permission import ServerConditions, judged
from app.cell.robot.state import RobotState
from app.cell.view.conditions import ORDER, ConditionRow, condition_row
from app.panel.condition import Interlock
from app.panel.model import Panel
from app.panel.widgets.families import Command
from app.panel.widgets.templated import is_stop
from app.system.texts import TextLike, say

MAX_ADVICE: Final = 3  # texts of what to do: those of the first interlocks that are not met


class LockRow(NamedTuple):
    """An interlock at one moment; `sentence` is the panel file's own while the value does not permit,
    "" otherwise."""

    row: ConditionRow
    sentence: TextLike


class LockHelp(NamedTuple):
    """`reasons` are those that are of no interlock or of one whose value is not known; `rows` has a row
    for each interlock, those that are not met first; `advice` is what to do, and `picture` shows it, ""
    for none."""

    title: TextLike
    summary: TextLike
    reasons: Sequence[TextLike]
    rows: Sequence[LockRow]
    advice: Sequence[TextLike]
    picture: TextLike


def lock_help(
    panel: Panel, widget: Command, robot: RobotState, now: float, grounds: ServerConditions
) -> LockHelp | None:
    """The help at `now` (monotonic seconds), None while the widget is not locked."""
    interlocks = panel.interlocks_of(widget)
    verdict = judged(widget, interlocks, robot, now, grounds)
    if verdict.permitted:
        return None
    link = link_verdict(robot, now)
    pairs = [(interlock, condition_row(interlock, robot, now)) for interlock in interlocks]
    pairs.sort(key=lambda pair: ORDER.index(pair[1].met))
    unmet = [interlock for interlock, row in pairs if row.met == "unmet"]
    own = {i.id: interlock_verdict(i, robot, now, link).reason or "" for i in unmet}
    said = {i.id: own[i.id] for i in unmet if i.locked}
    advice = [interlock.advice for interlock in unmet if interlock.advice][:MAX_ADVICE]
    if is_stop(widget):
        advice.insert(0, panel.stop_hint)
    return LockHelp(
        title=say("lock_title", label=widget.label),
        summary=_summary([row for _, row in pairs]),
        reasons=[reason for reason in verdict.reasons if reason not in own.values()],
        rows=[LockRow(row, said.get(interlock.id, "")) for interlock, row in pairs],
        advice=list(dict.fromkeys(advice)),
        picture=next(_pictures(unmet), ""),
    )


def without_page(widget: Command, reason: TextLike) -> LockHelp:
    """The help on a page that may only show: that is the one reason."""
    return LockHelp(say("lock_title", label=widget.label), "", [reason], [], [], "")


def _summary(rows: Sequence[ConditionRow]) -> TextLike:
    number = sum(row.met != "met" for row in rows)
    return say("conditions_unmet", number=number, total=len(rows)) if number else ""


def _pictures(interlocks: Sequence[Interlock]) -> Iterator[TextLike]:
    pictures = (interlock.help.picture for interlock in interlocks)
    return (picture for picture in pictures if picture)

"""Acts on control authority: the rows of take, ask, give, keep and release."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

from app.cell.commands.acts import Act, ActRequest, Applied, always, same_principal, server_permits
from app.cell.permission.control import LIFE_S, ControlAuthority, ControlRefusal, HandOver
from app.panel.roles import ANYBODY
from app.records.press_record import PressLog, origin_of
from app.records.principal import Principal
from app.system.texts import Text, say

# A page without scripts shows that it is open by its reload, at the latest after this time.
FORM_LIFE_S: Final = 35.0
TOO_OFTEN: Final = say("control_too_often")


@dataclass(frozen=True, slots=True, kw_only=True)
class ControlChange(Applied):
    """What an act of `who` changed: `holder` and `requester` are those before it, `has_control` whether
    `who` has control after it."""

    who: Principal
    holder: Principal | None
    requester: Principal | None
    has_control: bool


def _changes(
    apply: Callable[[ControlAuthority, ActRequest], ControlRefusal],
) -> Callable[[ControlAuthority, ActRequest], ControlChange]:
    """`Act.apply` from a function that returns the code of a refusal, "" if it was done."""

    def change(control: ControlAuthority, request: ActRequest) -> ControlChange:
        who, holder, requester = request.who, control.holder, control.requester
        code = apply(control, request)
        has_control = same_principal(who, control.holder)
        return ControlChange(
            say(code) if code else None,
            waits=not code and request.act == "ask" and not has_control,
            who=who,
            holder=holder,
            requester=requester,
            has_control=has_control,
        )

    return change


def _life_s(request: ActRequest) -> float:
    """How long the client counts as present."""
    return LIFE_S if request.scripted else FORM_LIFE_S


# Sentences of the operator's log.


def _took(change: ControlChange) -> Text:
    if change.holder is None or same_principal(change.who, change.holder):
        return say("log_done_take")
    return say("log_done_take_over", holder=change.holder.title)


def _asked(change: ControlChange) -> Text:
    if change.has_control or change.holder is None:
        return _took(change)
    return say("log_done_ask", holder=change.holder.title)


def _answered(code: str) -> Callable[[ControlChange], Text]:
    return lambda change: say(code, requester=change.requester.title if change.requester else "")


def _released(change: ControlChange) -> Text:
    had_it = same_principal(change.who, change.holder)
    return say("log_done_release" if had_it else "log_done_withdraw")


def _row(
    word: str,
    apply: Callable[[ControlAuthority, ActRequest], ControlRefusal],
    entry: Callable[[ControlChange], Text],
) -> Act[ControlAuthority, ControlChange]:
    return Act(word, server_permits, _changes(apply), entry)


CONTROL_ACTS: Final[Mapping[str, Act[ControlAuthority, ControlChange]]] = {
    "take": _row("log_page_control_take", lambda c, r: c.take(r.who, _life_s(r)), _took),
    "ask": _row("log_page_control_ask", lambda c, r: c.ask(r.who, _life_s(r)), _asked),
    "give": _row(
        "log_page_control_give", lambda c, r: c.give(r.who, r.object), _answered("log_done_give")
    ),
    "keep": _row(
        "log_page_control_keep", lambda c, r: c.keep(r.who, r.object), _answered("log_done_keep")
    ),
    "release": Act(
        "log_page_control_release", always, _changes(lambda c, r: c.release(r.who)), _released, ANYBODY
    ),
}


# The action of a change of control without an act, its sentence and its word, by how it came about.
HAND_OVERS: Final = {
    "lost": ("control_lost", "log_control_lost", "log_page_control_lost"),
    "idle": ("control_idle", "log_control_idle", "log_page_control_idle"),
    "first_page": ("control_first_page", "log_control_first_page", "log_page_control_first_page"),
    "request_lost": (
        "control_request_lost",
        "log_control_request_lost",
        "log_page_control_request_lost",
    ),
}


def log_hand_over(press_log: PressLog, hand_over: HandOver) -> None:
    """Logs a change of control without an act, such as a timeout. Does not wait for the disk."""
    who, other = hand_over.who, hand_over.other.title if hand_over.other else say("control_no_one")
    action, sentence, _ = HAND_OVERS[hand_over.how]
    reason = say(sentence, name=who.title, other=other)
    press_log.note(action, origin_of(who), reason)

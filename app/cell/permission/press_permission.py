"""May this client press this command now? An ordered table of checks; the first that locks decides.

It judges everything that can be pressed: what the view shows as locked, presses, holds, calls, actions
and parameters. A check is a row of `CHECKS`: a pure function from a question to a verdict, or None if
it does not apply.
"""

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final, NamedTuple

from app.cell.permission.interlocks import (
    LINK_CODES,
    blocked_buttons,
    command_blocked,
    interlock_verdict,
    link_verdict,
)
from app.cell.permission.robot_options import options_verdict
from app.cell.permission.roles import LOCK_CODES as CONFIRM_CODES
from app.cell.permission.roles import (
    ROLE_LOCK,
    UNKNOWN_USERS,
    ConfirmedBy,
    ConfirmLocks,
    role_verdict,
    unconfirmed,
)
from app.cell.permission.verdict import PERMITTED, WITHOUT_CONTROL, Verdict, locked, with_advice
from app.cell.robot.state import RobotState
from app.panel.condition import Interlock
from app.panel.model import Panel
from app.panel.widgets.families import Command
from app.panel.widgets.key_parts import confirmation_of
from app.panel.widgets.templated import is_stop, needs_control
from app.records.principal import Principal
from app.system.errors import Cause
from app.system.texts import TextLike


@dataclass(frozen=True, slots=True)
class ServerConditions:
    """Why the server itself locks a press.

    `ending`: the code of the lock while it shuts down or takes over another panel, "" else. `log_lock`:
    why the operator's log locks, "" if it does not. `control`: whether the client has control. `who` is
    None in a question for all clients. `inhibited`: the locks by alarms, by the widgets' ids. `needs`:
    the roles and groups that a command needs, by its id. `confirm_locks`: why no person can confirm a
    press. `pressed`: the question is about a press, which a person has `confirmed`, or None.
    """

    control: Verdict = PERMITTED
    log_lock: TextLike = ""
    ending: str = ""
    who: Principal | None = None
    inhibited: Mapping[str, Verdict] = field(default_factory=dict, hash=False)
    needs: Mapping[str, frozenset[str]] = field(default_factory=dict, hash=False)
    confirm_locks: ConfirmLocks = field(default=UNKNOWN_USERS, hash=False)
    pressed: bool = False
    confirmed: ConfirmedBy | None = None


NO_CONDITIONS: Final = ServerConditions()


class PermissionRequest(NamedTuple):
    """May `widget` be pressed at `now` (monotonic seconds)? `link` and `interlocks` (the widget's
    own, in their order) are verdicts that are known already: they are the same for many widgets."""

    widget: Command
    robot: RobotState
    now: float
    link: Verdict
    interlocks: Sequence[Verdict]
    grounds: ServerConditions = NO_CONDITIONS


class Check(NamedTuple):
    """`judge` returns a verdict, or None. If a check with `alone` locks, no later check is made; else
    their locks are listed beside it. `alike`: the verdict is the same for all uniform buttons with the
    same interlocks whose topic can be used."""

    name: str
    judge: Callable[[PermissionRequest], Verdict | None]
    alone: bool = True
    alike: bool = False


def _role(request: PermissionRequest) -> Verdict | None:
    """Locks for a client without a role or group that the command needs. What all clients see is
    locked for those in the view of their audience."""
    who = request.grounds.who
    if who is None:
        return None
    return role_verdict(request.grounds.needs.get(request.widget.id, ()), who)


def _confirmation(request: PermissionRequest) -> Verdict | None:
    """Locks what a person confirms, if no one can, or if no one has confirmed this press."""
    confirmation, grounds = confirmation_of(request.widget), request.grounds
    if not confirmation:
        return None
    if lock := grounds.confirm_locks.lock_of(request.widget.id):
        return lock
    if not grounds.pressed or grounds.who is None:
        return None
    return unconfirmed(confirmation, grounds.who, grounds.confirmed)


def _ending(request: PermissionRequest) -> Verdict | None:
    return locked(request.grounds.ending) if request.grounds.ending else None


def _log(request: PermissionRequest) -> Verdict | None:
    lock = request.grounds.log_lock
    return Verdict(False, "log", lock) if lock else None


def _control(request: PermissionRequest) -> Verdict:
    verdict = request.grounds.control
    return verdict if verdict.permitted or needs_control(request.widget) else WITHOUT_CONTROL


def _places(request: PermissionRequest) -> Verdict | None:
    """Imported only where a panel has places, for a faster start."""
    if request.widget.id not in request.robot.place_inputs:
        return None
    from app.cell.permission.goal_places import places_verdict

    return places_verdict(request.widget.id, request.robot, request.now)


CHECKS: Final = (
    Check("role", _role, alike=True),
    # Uniform buttons are those that no person confirms and no alarm locks.
    Check("confirmation", _confirmation, alike=True),
    Check("link", lambda request: request.link, alike=True),
    Check("ending", _ending, alike=True),
    Check("log", _log, alike=True),
    Check("control", _control, alike=True),
    Check(
        "command",
        lambda request: command_blocked(request.widget, request.robot, request.now),
        alone=False,
        alike=True,
    ),
    Check(
        "options",
        lambda request: options_verdict(request.widget.id, request.robot, request.now),
        alone=False,
        alike=True,
    ),
    Check(
        "places",
        _places,
        alone=False,
        alike=True,
    ),
    Check(
        "alarms",
        lambda request: request.grounds.inhibited.get(request.widget.id),
        alone=False,
        alike=True,
    ),
    Check("interlocks", lambda request: combined(request.interlocks), alone=False, alike=True),
)

# Why a receipt says that it was refused, by a verdict's code; "interlock" for all others.
CAUSES: Final[Mapping[str, Cause]] = {
    **dict.fromkeys(
        (
            *LINK_CODES,
            "service_unavailable",
            "parameter_node_unavailable",
            "service_connecting",
            "server_shutting_down",
            "panel_being_taken",
        ),
        "link",
    ),
    "log": "log",
    **dict.fromkeys((ROLE_LOCK, *CONFIRM_CODES), "role"),
}


def permission(question: PermissionRequest) -> Verdict:
    """The verdict of all checks, in their order."""
    verdicts = []
    for check in CHECKS:
        verdict = check.judge(question)
        if verdict is None or verdict is PERMITTED:
            continue
        verdicts.append(verdict)
        if check.alone and not verdict.permitted:
            break
    return combined(verdicts)


def permissions(
    panel: Panel,
    robot: RobotState,
    now: float,
    link: Verdict,
    interlocks: Mapping[str, Verdict],
    grounds: ServerConditions = NO_CONDITIONS,
) -> dict[str, Verdict]:
    """The verdicts of all commands of a panel, by their ids. Uniform buttons with the same interlocks
    are judged once, and get one object. A lock of a stop button says what to use instead."""

    def judge(widget: Command) -> Verdict:
        own = [interlocks[name] for name in widget.interlocks]
        return permission(PermissionRequest(widget, robot, now, link, own, grounds))

    verdicts: dict[str, Verdict] = {}
    alike = all(check.alike for check in CHECKS) and not (robot.selects or robot.place_inputs)
    groups = panel.uniform_buttons.values() if alike else ()
    for buttons in groups:
        blocked = blocked_buttons(buttons, robot)
        usable = [button for button in buttons if button.id not in blocked] if blocked else buttons
        if usable:
            verdicts.update(dict.fromkeys([button.id for button in usable], judge(usable[0])))
    for widget in panel.commands:
        if widget.id not in verdicts:
            verdicts[widget.id] = judge(widget)
    for widget in panel.stops:
        verdicts[widget.id] = with_hint(panel, widget, verdicts[widget.id])
    return verdicts


def with_hint(panel: Panel, widget: Command, verdict: Verdict) -> Verdict:
    """A lock of a stop button says what to use instead; any other verdict stays as it is."""
    return with_advice(verdict, panel.stop_hint) if is_stop(widget) else verdict


def judged(
    widget: Command,
    interlocks: Iterable[Interlock],
    robot: RobotState,
    now: float,
    grounds: ServerConditions = NO_CONDITIONS,
) -> Verdict:
    """Whether a widget with these interlocks may be pressed or held now."""
    link = link_verdict(robot, now)
    permissions = [interlock_verdict(interlock, robot, now, link) for interlock in interlocks]
    return permission(PermissionRequest(widget, robot, now, link, permissions, grounds))


def combined(verdicts: Sequence[Verdict]) -> Verdict:
    """The verdict of several that must all permit: the first that locks, with the others beside it. An
    operator can't act on an alarm that is not known: its lock comes last."""
    if not verdicts:
        return PERMITTED
    if len(verdicts) == 1:
        return verdicts[0]
    locking = [lock for verdict in verdicts for lock in _each(verdict) if not lock.permitted]
    locking.sort(key=lambda lock: lock.code == UNKNOWN_ALARM)
    until = min((verdict.until for verdict in verdicts), default=math.inf)
    if not locking:
        permitted = WITHOUT_CONTROL if WITHOUT_CONTROL in verdicts else PERMITTED
        return permitted if until == math.inf else replace(permitted, until=until)
    return replace(locking[0], until=until, others=tuple(locking[1:]))


def _each(verdict: Verdict) -> tuple[Verdict, ...]:
    return (replace(verdict, others=()), *verdict.others) if verdict.others else (verdict,)


UNKNOWN_ALARM: Final = "alarm_inhibits_unknown"


def cause_of(code: str) -> Cause:
    """Why a receipt says that the verdict with this code refused it."""
    return CAUSES.get(code, "interlock")

"""What follows when a user is no longer signed in at a browser."""

import logging
from functools import partial

from app.cell.commands.alarm_acts import confirm_key
from app.cell.commands.recipe_acts import edit_key
from app.cell.people.access import EndReason
from app.cell.people.confirmer import able_users
from app.cell.people.sessions import Session
from app.cell.permission.roles import confirm_lock, role_name, strictest
from app.cell.permission.verdict import Verdict
from app.panel.roles import MAINTENANCE, OPERATOR
from app.panel.widgets.key_parts import confirmation_of
from app.records.principal import Principal
from app.web.app_state import AppState

log = logging.getLogger("kiosk.access")


def renew_audiences(state: AppState) -> None:
    """What the browsers see may have changed, with a role."""
    for robot in state.fleet.sessions:
        robot.publisher.renew_audiences()


def release_control(state: AppState, session: Session, reason: EndReason) -> None:
    """A browser where no one is signed in has no control; a hand-over passes it to the next user."""
    if reason == "hand_over":
        return
    who = Principal(session.client)
    for robot in state.fleet.sessions:
        if robot.control.rules.required and not robot.control.release(who):
            robot.show()


def renew_confirm_locks(state: AppState) -> None:
    """Presses that no user, or too few users, can confirm are locked, and unlocked when they can."""
    panel, users = state.fleet.panel, able_users(state.access)
    provider = state.access.oidc is not None
    confirmed = [
        (command.id, confirmation_of(command), panel.needs.commands[command.id])
        for command in panel.commands
    ]
    for alarm in panel.alarms:
        needs = frozenset({alarm.needs or OPERATOR, OPERATOR})
        confirmed.append((confirm_key(alarm.id), alarm.confirm_act or "", needs))
    for table in panel.recipes:
        confirmed.append((edit_key(table.id), table.confirm_edit or "", frozenset({MAINTENANCE})))
    locks: dict[str, Verdict] = {}
    for name, confirmation, needs in confirmed:
        role = role_name(strictest(needs)) if needs else ""
        if confirmation and (lock := confirm_lock(confirmation, needs, users, role, provider)):
            locks[name] = lock
    if locks == state.fleet.confirm_locks.verdicts:
        return
    before, state.fleet.confirm_locks.verdicts = state.fleet.confirm_locks.verdicts, locks
    for name, lock in locks.items():
        if (before or {}).get(name) != lock:
            log.warning("%s is locked: %s", _described(name), lock.reason)
    for robot in state.fleet.sessions:
        robot.show()


def _described(name: str) -> str:
    """What is locked, by its name in `ConfirmLocks`."""
    for kind, prefix in (("alarm", confirm_key("")), ("changes of recipes", edit_key(""))):
        if name.startswith(prefix):
            return f'{kind} "{name.removeprefix(prefix)}"'
    return f'widget "{name}"'


def follow_users(state: AppState) -> None:
    """Has control released and the browsers' views renewed when users sign in or out."""
    if not state.access.configured:
        may = "may do everything" if state.access.rules.open else "may only watch"
        log.info('no users: everyone at this panel %s. "operator-panel users add" adds users', may)
    renew_confirm_locks(state)
    state.access.on_change(partial(renew_confirm_locks, state))
    state.access.on_end(partial(release_control, state))
    state.access.on_change(partial(renew_audiences, state))

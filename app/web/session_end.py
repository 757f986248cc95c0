"""What follows when a user is no longer signed in at a browser."""

from functools import partial

from app.access.access import EndReason
from app.access.sessions import Session
from app.permission.principal import Principal
from app.web.app_state import AppState


def renew_audiences(state: AppState) -> None:
    """What the browsers see may have changed, with a role."""
    for robot in state.fleet.sessions:
        robot.publisher.renew_audiences()


def release_control(state: AppState, session: Session, reason: EndReason) -> None:
    """A browser where nobody is signed in has no control; a hand-over passes it to the next user."""
    if reason == "hand_over":
        return
    who = Principal(session.client)
    for robot in state.fleet.sessions:
        if robot.control.rules.required and not robot.control.release(who):
            robot.show()


def follow_users(state: AppState) -> None:
    """Has control released and the browsers' views renewed when users sign in or out."""
    state.access.on_end(partial(release_control, state))
    state.access.on_change(partial(renew_audiences, state))

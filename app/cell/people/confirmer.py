"""Confirms single presses with the PIN, password or badge of a person who stands at the browser.

A confirmation is a token for one press of one widget with these inputs, of the session that asked for
it, within `VALID_S`. The secret itself goes no further than the check: presses have the token only.
"""

import secrets
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Final

from app.cell.people.access import Access, Attempt, SecretCheck
from app.cell.people.sessions import Session
from app.cell.people.users import name_key, rights_of
from app.cell.permission.roles import (
    BY_PROGRAM,
    SIGN_IN,
    WITHOUT_PIN,
    ConfirmedBy,
    role_lock,
    role_name,
    strictest,
    unmet,
)
from app.records.principal import Principal, anonymous
from app.system.limits import BoundedDict
from app.system.texts import say

VALID_S: Final = 30.0
MOST: Final = 200


@dataclass(frozen=True, slots=True)
class Question:
    """What is to be confirmed: a press of `widget` with inputs of this fingerprint, by the signed-in
    user ("pin") or by a second one ("two_persons"). `needs` is what both of them need."""

    widget: str
    inputs: str
    confirmation: str
    needs: frozenset[str]


@dataclass(frozen=True, slots=True)
class _Given:
    """A confirmation that no press has used yet."""

    session: str = field(repr=False)
    question: Question
    by: ConfirmedBy
    rights: tuple[object, ...] | None = field(repr=False)  # of who confirmed it
    until: float


class Confirmer:
    """Used on the event loop only."""

    def __init__(self, access: Access, monotonic: Callable[[], float] = time.monotonic) -> None:
        self._access = access
        self._monotonic = monotonic
        self._unused = BoundedDict[str, _Given](MOST)

    async def confirm(
        self, who: Principal, session: Session | None, question: Question, attempt: Attempt
    ) -> tuple[SecretCheck, str]:
        """Checks who confirms a press, with the delays of a sign-in; returns the token. TooMany if
        others check a secret already."""
        if refusal := _refusal(who, session, question, attempt):
            return refusal, ""
        if question.confirmation == "pin":
            if session is not None and session.role:
                return SecretCheck(None, say(WITHOUT_PIN), WITHOUT_PIN), ""
            attempt = replace(attempt, name=who.user)
        checked = await self._access.check(who.client, attempt, "confirm", question.widget)
        if checked.user is None or session is None:
            return checked, ""
        if self._access.sessions.get(session.id, who.client.id) is not session:
            return SecretCheck(None, say(SIGN_IN), SIGN_IN), ""
        by = ConfirmedBy(
            who.user, checked.user.name if question.confirmation != "pin" else "", attempt.way
        )
        if refused := self._refused_person(who, question, checked):
            await self._access.log.failed(
                who.client, checked.user.name, "confirm", question.widget, refused.reason
            )
            return refused, ""
        token = secrets.token_urlsafe(16)
        until = self._monotonic() + VALID_S
        self._unused[token] = _Given(session.id, question, by, rights_of(checked.user), until)
        return checked, token

    def _refused_person(
        self, who: Principal, question: Question, checked: SecretCheck
    ) -> SecretCheck | None:
        """Why this user, who exists, can't confirm; None if they can."""
        user = checked.user
        assert user is not None  # as the caller knows
        if question.confirmation == "pin":
            return None
        if user.name == who.user:
            return _same_person()
        lacks = unmet(question.needs, self._access.person(who.client, user))
        if not lacks:
            return None
        role = role_name(strictest(lacks))
        code = "confirm_second_role"
        return SecretCheck(None, say(code, name=user.name, role=role), code)

    def take(self, token: str, session: str, widget: str, inputs: str) -> ConfirmedBy | None:
        """Who confirmed a press, which uses the confirmation up; None if no one did, or it is too old,
        or the user may do something else now."""
        kept = self._unused.pop(token, None)
        if kept is None or self._monotonic() > kept.until:
            return None
        asked = (kept.session, kept.question.widget, kept.question.inputs)
        if asked != (session, widget, inputs):
            return None
        person = self._access.book.user(kept.by.second or kept.by.user)
        return kept.by if rights_of(person) == kept.rights else None


def able_users(access: Access) -> list[Principal]:
    """The users who can sign in, as they are at the panel itself."""
    here = anonymous("127.0.0.1")
    return [access.person(here, user) for user in access.book.users if user.ways and not user.disabled]


def _refusal(
    who: Principal, session: Session | None, question: Question, attempt: Attempt
) -> SecretCheck | None:
    """Why this client can't have a press confirmed, before a secret is looked at."""
    if who.program:
        return SecretCheck(None, say(BY_PROGRAM), BY_PROGRAM)
    if session is None or not who.user:
        return SecretCheck(None, say(SIGN_IN), SIGN_IN)
    if lacks := unmet(question.needs, who):
        lock = role_lock(strictest(lacks))
        return SecretCheck(None, lock.reason or "", lock.code)
    is_own = name_key(attempt.name) == name_key(who.user)
    return _same_person() if question.confirmation == "two_persons" and is_own else None


def _same_person() -> SecretCheck:
    return SecretCheck(None, say("confirm_same_person"), "confirm_same_person")

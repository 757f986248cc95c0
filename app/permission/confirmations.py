"""Presses that a person confirms with a PIN, password or badge: who did, and why nobody can. Pure."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Literal

from app.i18n import Text, TextLike, say
from app.permission.principal import Principal
from app.permission.verdict import Verdict, locked

Means = Literal["pin", "password", "badge"]

NEEDED: Final = {"pin": "confirm_needed_pin", "two_persons": "confirm_needed_two"}
WITHOUT_USERS: Final = "confirm_without_users"
WITHOUT_SECOND: Final = "confirm_without_second"
SIGN_IN: Final = "confirm_sign_in"
BY_PROGRAM: Final = "confirm_by_program"
WITHOUT_PIN: Final = "confirm_without_pin"  # a user of the plant's provider
BY_ONE: Final[Mapping[Means, str]] = {
    "pin": "confirmed_pin",
    "password": "confirmed_password",
    "badge": "confirmed_badge",
}
BY_TWO: Final[Mapping[Means, str]] = {
    "pin": "confirmed_two_pin",
    "password": "confirmed_two_password",
    "badge": "confirmed_two_badge",
}
CONFIRMED_CODES: Final = frozenset((*BY_ONE.values(), *BY_TWO.values()))
LOCK_CODES: Final = (*NEEDED.values(), WITHOUT_USERS, WITHOUT_SECOND, SIGN_IN, BY_PROGRAM)


@dataclass(frozen=True, slots=True)
class ConfirmedBy:
    """A confirmation of one press: the signed-in user, the second one ("" without), and by what."""

    user: str
    second: str
    means: Means

    @property
    def said(self) -> Text:
        """For the receipt and the operator's log."""
        if self.second:
            return say(BY_TWO[self.means], user=self.user, second=self.second)
        return say(BY_ONE[self.means], user=self.user)


@dataclass(slots=True, eq=False)
class ConfirmLocks:
    """Why nobody can confirm a press, by the ids of the commands; kept by what knows the users. Until
    it does, every command that a person confirms is locked."""

    verdicts: Mapping[str, Verdict] | None = None

    def lock_of(self, command: str) -> Verdict | None:
        if self.verdicts is None:
            return locked(WITHOUT_USERS)
        return self.verdicts.get(command)


UNKNOWN_USERS: Final = ConfirmLocks()


def confirm_lock(
    confirmation: str,
    needs: frozenset[str],
    users: Sequence[Principal],
    role: TextLike,
    provider: bool = False,
) -> Verdict | None:
    """Why a command can't be confirmed by any of the panel's users; None if it can. `role` names what
    both persons need. With the plant's `provider` the first of two persons may be a user of it."""
    if not users:
        return locked(WITHOUT_USERS)
    able = [user for user in users if all(user.meets(need) for need in needs)]
    if confirmation == "two_persons" and len(able) < (1 if provider else 2):
        return Verdict(False, WITHOUT_SECOND, say(WITHOUT_SECOND, role=role))
    return None


def unconfirmed(confirmation: str, who: Principal, confirmed: ConfirmedBy | None) -> Verdict | None:
    """Why a press of a client is not confirmed; None if it is."""
    if who.program:
        return locked(BY_PROGRAM)
    if not who.user:
        return locked(SIGN_IN)
    return None if confirmed else locked(NEEDED[confirmation])

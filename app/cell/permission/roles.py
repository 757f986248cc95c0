"""Locks by role: what a client lacks, and presses that a person confirms with a PIN, password or badge.
Pure."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Final, Literal

from app.cell.permission.verdict import Verdict, locked
from app.panel.roles import ENGINEER, MAINTENANCE, OPERATOR, ROLES, VIEWER
from app.records.principal import Principal
from app.system.texts import Text, TextLike, say

# Locks for clients without the role or group that something needs: pure.

ROLE_LOCK: Final = "role_needed"
ROLE_NAMES: Final = {
    VIEWER: "role_viewer",
    OPERATOR: "role_operator",
    MAINTENANCE: "role_maintenance",
    ENGINEER: "role_engineer",
}


def role_name(need: str) -> TextLike:
    """A role in the reader's language; a group by its own name."""
    return say(ROLE_NAMES[need]) if need in ROLE_NAMES else need


@lru_cache(maxsize=64)
def role_reason(need: str) -> Text:
    """Why it is locked, and what to do: "Sign in as maintenance"."""
    return say(ROLE_LOCK, role=role_name(need))


@lru_cache(maxsize=64)
def role_lock(need: str) -> Verdict:
    """The lock for a client without this role or group."""
    return Verdict(False, ROLE_LOCK, role_reason(need))


def role_verdict(needs: Collection[str], who: Principal) -> Verdict | None:
    """The lock for the most that a client lacks, None if it lacks nothing."""
    lacks = unmet(needs, who)
    return role_lock(strictest(lacks)) if lacks else None


def unmet(needs: Collection[str], who: Principal) -> frozenset[str]:
    """The roles and groups of these that a client does not have."""
    return frozenset(need for need in needs if not who.meets(need))


def strictest(needs: Collection[str]) -> str:
    """The need to name to an operator: the highest role, or else the first group."""
    roles = [role for role in ROLES if role in needs]
    groups = sorted(need for need in needs if need not in ROLES)
    return groups[0] if groups else roles[-1]


# Presses that a person confirms with a PIN, password or badge: who did, and why no one can. Pure.

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
    def sentence(self) -> Text:
        """For the receipt and the operator's log."""
        if self.second:
            return say(BY_TWO[self.means], user=self.user, second=self.second)
        return say(BY_ONE[self.means], user=self.user)


@dataclass(slots=True, eq=False)
class ConfirmLocks:
    """Why no one can confirm a press, by the ids of the commands; kept by what knows the users. Until
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

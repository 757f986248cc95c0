"""Locks for clients without the role or group that something needs: pure."""

from collections.abc import Collection
from functools import lru_cache
from typing import Final

from app.i18n import Text, TextLike, say
from app.permission.principal import Principal
from app.permission.verdict import Verdict
from app.roles import ROLES

ROLE_LOCK: Final = "role_needed"


def role_name(need: str) -> TextLike:
    """A role in the reader's language; a group by its own name."""
    return say(f"role_{need}") if need in ROLES else need


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
    return role_lock(hardest(lacks)) if lacks else None


def unmet(needs: Collection[str], who: Principal) -> frozenset[str]:
    """The roles and groups of these that a client does not have."""
    return frozenset(need for need in needs if not who.meets(need))


def hardest(needs: Collection[str]) -> str:
    """The need to name to an operator: the highest role, or else the first group."""
    roles = [role for role in ROLES if role in needs]
    groups = sorted(need for need in needs if need not in ROLES)
    return groups[0] if groups else roles[-1]

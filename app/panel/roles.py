"""Roles of users, from the least to the most that they may do."""

from typing import Final

ANYBODY: Final = ""  # a need that everyone meets
VIEWER: Final = "viewer"
OPERATOR: Final = "operator"
MAINTENANCE: Final = "maintenance"
ENGINEER: Final = "engineer"
ROLES: Final = (VIEWER, OPERATOR, MAINTENANCE, ENGINEER)


def meets(needs: str, role: str, groups: frozenset[str] = frozenset()) -> bool:
    """Whether a user with this role and these groups may do what `needs` a role or a group of the
    panel's own. A higher role includes the lower ones; a group is included by the engineer only. ""
    needs nothing."""
    if not needs or role == ENGINEER:
        return True
    if needs in ROLES:
        return role in ROLES and ROLES.index(role) >= ROLES.index(needs)
    return needs in groups

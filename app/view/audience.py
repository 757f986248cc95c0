"""Audiences: clients that see the same view."""

from collections.abc import Mapping
from functools import lru_cache
from typing import Final, NamedTuple

from app.i18n import ENGLISH
from app.panel.rules import ControlRules
from app.permission.control_authority_view import IN_CONTROL, ControlView, Role, role
from app.permission.principal import Principal
from app.permission.role_locks import unmet

NOTHING: Final[frozenset[str]] = frozenset()


class Audience(NamedTuple):
    """Clients that see the same view, but for the page. `has_control`: control authority locks none of
    their buttons. `role` decides what they read of control, `language` in which language. `without` are
    the other robots with widgets on the page which the clients do not control. `lacks` are the roles
    and groups named in the panel that the clients do not have."""

    has_control: bool = True
    role: Role = ""
    language: str = ENGLISH
    without: frozenset[str] = frozenset()
    lacks: frozenset[str] = NOTHING

    @property
    def sees_all(self) -> bool:
        """Whether the view is for it as it is."""
        return not self.role and not self.lacks


NO_OTHERS: Final[Mapping[str, ControlView]] = {}
EVERYONE: Final = Audience()  # where control is not required, in English


@lru_cache(maxsize=512)
def audience(
    role: Role,
    language: str = ENGLISH,
    without: frozenset[str] = NOTHING,
    lacks: frozenset[str] = NOTHING,
) -> Audience:
    """The audience of clients of a role in control; the same object for the same."""
    return Audience(role in IN_CONTROL, role, language, without, lacks)


def audience_of(
    who: Principal,
    control: ControlView,
    rules: ControlRules,
    language: str,
    others: Mapping[str, ControlView] = NO_OTHERS,
    needs: frozenset[str] = NOTHING,
) -> Audience:
    """The audience of a client now. `others` has the control of other robots by their ids; `needs` are
    the roles and groups named in the panel."""
    without = frozenset(
        robot for robot, view in others.items() if role(view, who, rules) not in IN_CONTROL
    )
    return audience(role(control, who, rules), language, without, unmet(needs, who))

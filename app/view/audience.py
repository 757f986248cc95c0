"""Audiences: clients that see the same view."""

from collections.abc import Mapping
from functools import lru_cache
from typing import Final, NamedTuple

from app.i18n import ENGLISH
from app.panel.rules import ControlRules
from app.permission.control_authority_view import IN_CONTROL, ControlView, Role, role
from app.permission.principal import Principal


class Audience(NamedTuple):
    """Clients that see the same view, but for the page. `has_control`: control authority locks none of
    their buttons. `role` decides what they read of control, `language` in which language. `without` are
    the other robots with widgets on the page which the clients do not control."""

    has_control: bool = True
    role: Role = ""
    language: str = ENGLISH
    without: frozenset[str] = frozenset()


NO_OTHERS: Final[Mapping[str, ControlView]] = {}
EVERYONE: Final = Audience()  # where control is not required, in English


@lru_cache(maxsize=256)
def audience(role: Role, language: str = ENGLISH, without: frozenset[str] = frozenset()) -> Audience:
    """The audience of clients of a role in control; the same object for the same."""
    return Audience(role in IN_CONTROL, role, language, without)


def audience_of(
    who: Principal,
    control: ControlView,
    rules: ControlRules,
    language: str,
    others: Mapping[str, ControlView] = NO_OTHERS,
) -> Audience:
    """The audience of a client now. `others` has the control of other robots by their ids."""
    without = frozenset(
        robot for robot, view in others.items() if role(view, who, rules) not in IN_CONTROL
    )
    return audience(role(control, who, rules), language, without)

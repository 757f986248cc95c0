"""Audiences: clients that see the same view."""

from functools import lru_cache
from typing import Final, NamedTuple

from app.i18n import ENGLISH
from app.panel.rules import ControlRules
from app.permission.control_authority_view import IN_CONTROL, ControlView, Role, role
from app.permission.principal import Principal


class Audience(NamedTuple):
    """Clients that see the same view, but for the page. `has_control`: control authority locks none of
    their buttons. `role` decides what they read of control, `language` in which language."""

    has_control: bool = True
    role: Role = ""
    language: str = ENGLISH


EVERYONE: Final = Audience()  # where control is not required, in English


@lru_cache(maxsize=256)
def audience(role: Role, language: str = ENGLISH) -> Audience:
    """The audience of clients of a role in control; the same object for the same."""
    return Audience(role in IN_CONTROL, role, language)


def audience_of(who: Principal, control: ControlView, rules: ControlRules, language: str) -> Audience:
    """The audience of a client now."""
    return audience(role(control, who, rules), language)

"""What pages show of who is signed in, and the words of the page of sign-in."""

from dataclasses import dataclass
from typing import Final

from app.i18n import Text, TextLike, say
from app.permission.principal import Principal
from app.roles import ENGINEER
from app.web.app_state import AppState

ROLE_WORDS: Final = {
    "viewer": say("role_viewer"),
    "operator": say("role_operator"),
    "maintenance": say("role_maintenance"),
    "engineer": say("role_engineer"),
}
WORDS: Final = (
    "who", "sign_in", "sign_out", "other", "pin", "password", "view_only", "stop_works", "badge",
    "name", "by_pin", "by_password", "clear", "delete", "choose", "typed", "back", "more",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class SignedIn:
    """`user` is "" for nobody, `name` what the header shows then; `hint` says what to do on a panel
    without users, "" on one with users. `changes_users`: the menu leads to the page of users."""

    configured: bool
    user: str
    name: TextLike
    role: TextLike
    label: TextLike
    idle: TextLike
    hint: TextLike
    changes_users: bool


def signed_in(state: AppState, who: Principal) -> SignedIn:
    """Who is signed in at the browser of a request."""
    configured = state.access.configured
    name: TextLike = who.user or say("signin_nobody")
    role: TextLike = ROLE_WORDS[who.role] if who.user else say("signin_not_signed_in")
    return SignedIn(
        configured,
        who.user,
        name,
        role,
        say("signin_label", name=name, role=role),
        say("signin_idle"),
        "" if configured else say("signin_no_users"),
        who.role == ENGINEER and (configured or who.client.local),
    )


def initials(name: str) -> str:
    """Up to two letters for a name: "MS" for "M. Sato"."""
    parts = [part for part in name.replace(".", " ").replace("-", " ").split() if part]
    return (parts[0][0] + parts[-1][0] if len(parts) > 1 else name[:2]).upper()


def sign_in_words() -> dict[str, Text]:
    """The words of the page, by their names in the template."""
    return {name: say(f"signin_{name}") for name in WORDS}

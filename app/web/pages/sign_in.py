"""What pages show of who is signed in, and the page of sign-in: its words, and its tiles of users."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from app.cell.people.users import User
from app.panel.roles import ENGINEER
from app.records.principal import Principal
from app.system.texts import Text, TextLike, say
from app.web.app_state import AppState

# What pages show of who is signed in, and the words of the page of sign-in.

ROLE_WORDS: Final = {
    "viewer": say("role_viewer"),
    "operator": say("role_operator"),
    "maintenance": say("role_maintenance"),
    "engineer": say("role_engineer"),
}
WORDS: Final = {
    "who": "signin_who",
    "sign_in": "signin_sign_in",
    "sign_out": "signin_sign_out",
    "own": "users_page_own",
    "other": "signin_other",
    "pin": "signin_pin",
    "password": "signin_password",
    "view_only": "signin_view_only",
    "stop_works": "signin_stop_works",
    "badge": "signin_badge",
    "name": "signin_name",
    "by_pin": "signin_by_pin",
    "by_password": "signin_by_password",
    "clear": "signin_clear",
    "delete": "signin_delete",
    "choose": "signin_choose",
    "typed": "signin_typed",
    "back": "signin_back",
    "more": "signin_more",
    "checking": "signin_checking",
    "scripts": "signin_pad_needs_javascript",
}


@dataclass(frozen=True, slots=True)
class SignedIn:
    """`user` is "" without a sign-in, `name` what the header shows then; `idle` and `longest` announce
    the sign-out; `hint` says what to do on a
    panel without users, "" on one with users. `changes_users`: the menu leads to the page of users."""

    configured: bool
    user: str
    name: TextLike
    role: TextLike
    label: TextLike
    idle: TextLike
    longest: TextLike
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
        say("signin_longest"),
        "" if configured else say("signin_no_users"),
        who.role == ENGINEER and (configured or who.client.local),
    )


def initials(name: str) -> str:
    """Up to two letters for a name: "MS" for "M. Sato"."""
    parts = [part for part in name.replace(".", " ").replace("-", " ").split() if part]
    return (parts[0][0] + parts[-1][0] if len(parts) > 1 else name[:2]).upper()


def sign_in_words() -> dict[str, Text]:
    """The words of the page, by their names in the template."""
    return {name: say(code) for name, code in WORDS.items()}


# The tiles of users on the page of sign-in, in pages that fit on the lowest screen.

ROOM: Final = 8  # tiles beside "Other user" and "View only"
OTHERS: Final = 2  # these two
FEW: Final = 6  # tiles, which are high
TURNING: Final = 2  # as many make room for the buttons that turn the pages


@dataclass(frozen=True, slots=True)
class UserTile:
    """A user; `mark` are the letters of the name."""

    name: str
    role: TextLike
    mark: str


@dataclass(frozen=True, slots=True)
class TilePage:
    """One page of tiles. `page` counts from 1; `spaces` are the empty places of the last page, so that
    no button moves when the page turns. `where` says which page it is, "" for the only one; `is_many`:
    the tiles are low."""

    users: tuple[UserTile, ...]
    page: int
    pages: int
    spaces: int
    is_many: bool

    @property
    def where(self) -> TextLike:
        if self.pages == 1:
            return ""
        return say("signin_page", page=str(self.page), pages=str(self.pages))


def tile_page(users: Sequence[User], chosen: str, page: int, further: int) -> TilePage:
    """The page with this number, or with 0 the one with the chosen user. `further` tiles are on every
    page, such as that of the plant's provider."""
    room = ROOM - further
    size = room if len(users) <= room else room - TURNING
    pages = max(1, -(-len(users) // size))
    names = [user.name for user in users]
    own = names.index(chosen) // size + 1 if chosen in names else 1
    page = min(page or own, pages)
    shown = users[(page - 1) * size : page * size]
    tiles = tuple(UserTile(user.name, ROLE_WORDS[user.role], initials(user.name)) for user in shown)
    spaces = size - len(shown) if pages > 1 else 0
    every = len(tiles) + spaces + further + OTHERS
    return TilePage(tiles, page, pages, spaces, every > FEW)

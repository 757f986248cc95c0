"""The tiles of users on the page of sign-in, in pages that fit on the lowest screen."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from app.access.users import User
from app.i18n import TextLike, say
from app.web.rendering.sign_in_words import ROLE_WORDS, initials

ROOM: Final = 8  # tiles beside "Other user" and "View only"
TURNING: Final = 2  # as many make room for the buttons that turn the pages


@dataclass(frozen=True, slots=True)
class Tile:
    """A user; `mark` are the letters of the name."""

    name: str
    role: TextLike
    mark: str


@dataclass(frozen=True, slots=True)
class TilePage:
    """One page of tiles. `page` counts from 1; `spaces` are the empty places of the last page, so that
    no button moves when the page turns. `where` says which page it is, "" for the only one."""

    users: tuple[Tile, ...]
    page: int
    pages: int
    spaces: int

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
    tiles = tuple(Tile(user.name, ROLE_WORDS[user.role], initials(user.name)) for user in shown)
    return TilePage(tiles, page, pages, size - len(shown) if pages > 1 else 0)

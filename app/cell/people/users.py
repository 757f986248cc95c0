"""Users and tokens as the users' file has them: read, checked, changed. No I/O."""

import json
import re
import secrets
import unicodedata
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any, Final, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from app.cell.people.secrets_hash import Way, same_text, token_hash
from app.panel.roles import ENGINEER, ROLES
from app.system.errors import KioskError
from app.system.texts import say

VERSION: Final = 1
CHANGES_KEPT: Final = 500
MOST_USERS: Final = 500
GROUP: Final = re.compile(r"[a-z][a-z0-9_]{0,63}")
LONGEST_NAME: Final = 40
OPEN: Final = "open"  # the change that opens a panel for everyone


class UsersError(KioskError):
    """A change of users that can't be made; the message says what would be right."""


@dataclass(frozen=True, slots=True)
class User:
    """`pin`, `password` and `badge` are hashes, "" for none. `created` and `changed` are ISO 8601."""

    name: str
    role: str
    groups: tuple[str, ...] = ()
    pin: str = field(default="", repr=False)
    password: str = field(default="", repr=False)
    badge: str = field(default="", repr=False)
    disabled: bool = False
    created: str = ""
    changed: str = ""

    def hash_of(self, way: Way) -> str:
        hashes = {"pin": self.pin, "password": self.password, "badge": self.badge}
        return hashes[way]

    def with_hashes(self, hashes: Mapping[Way, str]) -> "User":
        """With other hashes, by the ways to sign in."""
        return replace(
            self,
            pin=hashes.get("pin", self.pin),
            password=hashes.get("password", self.password),
            badge=hashes.get("badge", self.badge),
        )

    @property
    def ways(self) -> tuple[Way, ...]:
        """How this user signs in."""
        every: tuple[Way, ...] = ("pin", "password", "badge")
        return tuple(way for way in every if self.hash_of(way))


def rights_of(user: User | None) -> tuple[object, ...] | None:
    """What a session depends on; None for a user who can't sign in."""
    if user is None or user.disabled:
        return None
    return user.role, frozenset(user.groups), user.pin, user.password, user.badge


@dataclass(frozen=True, slots=True)
class ApiToken:
    """A token of a program; `hash` is SHA-256 in hex."""

    name: str
    role: str
    hash: str = field(repr=False)
    created: str = ""


@dataclass(frozen=True, slots=True)
class UserChange:
    """A change of users for the operator's log. `act` is like "add", `by` the account or user who made
    it, `address` and `browser` those of a browser that they made it at."""

    number: int
    at: str
    act: str
    name: str
    detail: str
    by: str
    address: str = ""
    browser: str = ""


@dataclass(frozen=True, slots=True)
class UserBook:
    """What the users' file has. `badge_salt` is hex."""

    users: tuple[User, ...] = ()
    tokens: tuple[ApiToken, ...] = ()
    changes: tuple[UserChange, ...] = ()
    badge_salt: str = field(default_factory=lambda: secrets.token_hex(16), repr=False)

    @property
    def configured(self) -> bool:
        """Whether the panel has or had users, so that its clients have roles. The removal of the last
        one does not open it: that is a change of its own."""
        return bool(self.users or self.tokens or (self.changes and not self.opened))

    @property
    def opened(self) -> bool:
        """Whether somebody has opened the panel, which had users, for everyone."""
        empty = not self.users and not self.tokens
        return empty and bool(self.changes) and self.changes[-1].act == OPEN

    @property
    def engineers(self) -> tuple[User, ...]:
        """The users who can sign in as engineers."""
        return tuple(u for u in self.users if u.role == ENGINEER and not u.disabled and u.ways)

    def version(self, name: str) -> int:
        """The number of the last change of the user or token of this name, 0 for none that is kept."""
        key = name_key(name)
        return max((c.number for c in self.changes if name_key(c.name) == key), default=0)

    def user(self, name: str) -> User | None:
        """The user of this name, in upper or lower case."""
        key = name_key(name)
        return next((user for user in self.users if name_key(user.name) == key), None)

    def user_of_badge(self, badge: str) -> User | None:
        """The user whose badge has this hash."""
        return next((user for user in self.users if user.badge and same_text(user.badge, badge)), None)

    def token(self, token: str) -> ApiToken | None:
        wanted = token_hash(token)
        return next((known for known in self.tokens if same_text(known.hash, wanted)), None)

    def with_user(self, user: User, now: str) -> "UserBook":
        """With a user added, or changed."""
        known = self.user(user.name)
        if known is None:
            if len(self.users) >= MOST_USERS:
                raise UsersError(say("users_full", count=MOST_USERS))
            return replace(self, users=(*self.users, replace(user, created=now, changed=now)))
        changed = replace(user, changed=now)
        return replace(self, users=tuple(changed if other is known else other for other in self.users))

    def without_user(self, name: str) -> "UserBook":
        return replace(self, users=tuple(user for user in self.users if user.name != name))

    def with_change(
        self, now: str, act: str, name: str, detail: str, by: str, address: str = "", browser: str = ""
    ) -> "UserBook":
        """With a change for the operator's log."""
        number = self.changes[-1].number + 1 if self.changes else 1
        change = UserChange(number, now, act, name, detail, by, address, browser)
        return replace(self, changes=(*self.changes, change)[-CHANGES_KEPT:])

    def as_text(self) -> str:
        content = {"version": VERSION, **asdict(self)}
        return json.dumps(content, ensure_ascii=False, indent=1) + "\n"


def name_key(name: str) -> str:
    """Equal for names that are the same, in upper or lower case and however they were typed."""
    return unicodedata.normalize("NFC", name).casefold()


Edit = Callable[[UserBook], UserBook]


NAME_FAULTS: Final = {"user": "users_name_of_user", "token": "users_name_of_token"}


def check_name(name: str, kind: Literal["user", "token"] = "user") -> str:
    """The name, if it can be one; UsersError says what would be right."""
    if not name or len(name) > LONGEST_NAME or not name.isprintable() or name != name.strip():
        raise UsersError(say(NAME_FAULTS[kind], name=name[:LONGEST_NAME], most=LONGEST_NAME))
    return name


def check_role(role: str) -> str:
    if role not in ROLES:
        raise UsersError(say("users_role_unknown", role=role[:LONGEST_NAME], roles=", ".join(ROLES)))
    return role


def check_group(group: str) -> str:
    if not GROUP.fullmatch(group) or group in ROLES:
        raise UsersError(say("users_group_form", group=group[:LONGEST_NAME]))
    return group


class _User(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)
    name: str = Field(min_length=1, max_length=LONGEST_NAME)
    role: str
    groups: list[str] = []
    pin: str = ""
    password: str = ""
    badge: str = ""
    disabled: bool = False
    created: str = ""
    changed: str = ""


class _Token(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)
    name: str
    role: str
    hash: str
    created: str = ""


class _Change(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)
    number: int
    at: str
    act: str
    name: str
    detail: str
    by: str
    address: str = ""
    browser: str = ""


class _Book(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)
    version: int
    users: list[_User] = []
    tokens: list[_Token] = []
    changes: list[_Change] = []
    badge_salt: str = Field(pattern=r"^[0-9a-f]{32}$")


def book_of(text: str) -> UserBook:
    """The book of a file's text; UsersError names the first fault, never a secret or hash."""
    try:
        content: Any = json.loads(text)
        book = _Book.model_validate(content)
    except ValidationError as error:
        first = error.errors(include_url=False, include_input=False)[0]
        place = ".".join(str(step) for step in first["loc"])
        raise UsersError(f"{place}: {first['msg']}") from None
    except (ValueError, RecursionError):
        raise UsersError("not JSON") from None
    if book.version != VERSION:
        raise UsersError(f"version {book.version}: this program reads version {VERSION}")
    for role in (*(user.role for user in book.users), *(token.role for token in book.tokens)):
        check_role(role)
    names = [name_key(user.name) for user in book.users]
    if len({*names}) < len(names):
        raise UsersError("a user's name is there twice")
    return UserBook(
        tuple(User(**{**user.model_dump(), "groups": tuple(user.groups)}) for user in book.users),
        tuple(ApiToken(**token.model_dump()) for token in book.tokens),
        tuple(UserChange(**change.model_dump()) for change in book.changes),
        book.badge_salt,
    )

"""The page of users: the list of users, tokens or sign-ins, one of them, and the forms that change it;
the page of one's own sign-ins is the same."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Any, Final, Literal, TypedDict

from app.cell.commands.acts import NO_VALUES
from app.cell.people.access import Access
from app.cell.people.secrets_hash import WAYS, Way
from app.cell.people.sessions import Session
from app.cell.people.users import User
from app.panel.roles import ENGINEER, OPERATOR, ROLES
from app.records.principal import Principal
from app.system.clock import format_age, format_datetime
from app.system.texts import Param, Text, TextLike, joined, number, say
from app.web.pages.sign_in import ROLE_WORDS

Mode = Literal["show", "add", "role", "pin", "password", "badge", "remove", "token", "revoke", "end"]
Listed = Literal["users", "tokens", "sessions", "own"]
GROUP: Final = "group-"  # stands before the id of a group in a form
OF_LISTS: Final[Mapping[str, Listed]] = {"token": "tokens", "revoke": "tokens", "end": "sessions"}


@dataclass(frozen=True, slots=True)
class UserRow:
    """A user, token or sign-in in the list. `title` is its name for people, "" where that is `name`."""

    name: str
    about: TextLike
    mark: TextLike = ""
    title: TextLike = ""


@dataclass(frozen=True, slots=True)
class SelectedAccount:
    """The user, token or sign-in that is shown: its facts as (name, text); `version` is the number of
    its last change. `title` is its name for people, "" where that is `name`. `here`: it is the sign-in
    at this browser."""

    name: str
    role: str
    groups: Sequence[str]
    ways: Sequence[Way]
    disabled: bool
    facts: list[tuple[Text, TextLike]]
    version: int
    title: TextLike = ""
    here: bool = False


class UsersContext(TypedDict):
    """The variables of `users.html`, beside those of the frame. `typed` is what a refused form had."""

    listed: Listed
    mode: Mode
    rows: list[UserRow]
    count: Text
    chosen: SelectedAccount | None
    detailed: bool
    roles: Mapping[str, TextLike]
    groups: Sequence[str]
    typed: Mapping[str, Any]
    said: TextLike
    token: str
    is_open: bool


def word(name: str, /, **about: Param) -> Text:
    return say(f"users_page_{name}", **about)


def users_context(
    access: Access,
    groups: Sequence[str],
    who: Principal,
    name: str,
    listed: Listed,
    mode: Mode,
    said: TextLike = "",
    refused: Mapping[str, str] = NO_VALUES,
    token: str = "",
) -> UsersContext:
    """What the page shows now. `name` is that of the chosen user, token or sign-in, `refused` what was
    typed in a form that is shown again, `token` one that was made just now."""
    listed = OF_LISTS.get(mode, listed)
    rows_of, details = LISTS[listed]
    rows = rows_of(access, who)
    names = [row.name for row in rows]
    shown = name if name in names else next(iter(names), "") if not name else ""
    chosen = details(access, shown, who) if shown else None
    if not access.configured and mode == "show":
        mode = "add"
    needs_one = mode not in ("show", "add", "token")
    typed = _typed(refused, chosen if mode == "role" else None, ENGINEER if not rows else OPERATOR)
    of_user = chosen.groups if chosen else ()
    return UsersContext(
        listed=listed,
        mode="show" if needs_one and chosen is None else mode,
        rows=rows,
        count=word("count", count=number(str(len(rows)))),
        chosen=chosen,
        detailed=bool(name) and chosen is not None,
        roles={role: ROLE_WORDS[role] for role in ROLES},
        groups=tuple(dict.fromkeys((*groups, *of_user))),
        typed=typed,
        said=said,
        token=token,
        is_open=not access.configured,
    )


def _typed(refused: Mapping[str, str], chosen: SelectedAccount | None, role: str) -> dict[str, Any]:
    """What the fields of the form have at first."""
    empty = {"name": "", "role": role, "groups": (), "way": WAYS[0]}
    if refused:
        groups = [name.removeprefix(GROUP) for name in refused if name.startswith(GROUP)]
        return {**empty, **refused, "groups": groups}
    if chosen is not None:
        return {**empty, "role": chosen.role, "groups": chosen.groups}
    return empty


def _row(user: User, who: Principal) -> UserRow:
    is_self = user.name == who.user
    mark: TextLike = word("you") if is_self else word("disabled") if user.disabled else ""
    return UserRow(user.name, _role(user.role, user.groups), mark)


def _user_rows(access: Access, who: Principal) -> list[UserRow]:
    return [_row(user, who) for user in access.book.users]


def _session_rows(access: Access, who: Principal) -> list[UserRow]:
    """The newest touch first."""
    rows = []
    for session in reversed([*access.sessions]):
        mark = word("you") if _is_here(session, who) else ""
        rows.append(UserRow(session.handle, _where(session), mark, session.user))
    return rows


def _own_rows(access: Access, who: Principal) -> list[UserRow]:
    """Those of the user who is signed in, the newest touch first."""
    rows = []
    for session in reversed(access.own_sessions(who)):
        mark = word("here") if _is_here(session, who) else ""
        rows.append(UserRow(session.handle, _since(access, session), mark, session.client.title))
    return rows


def _is_here(session: Session, who: Principal) -> bool:
    return session.client.id == who.client.id


def _since(access: Access, session: Session) -> Text:
    began_s, _ = access.sessions.seen_s(session)
    return format_datetime(time.time() - began_s)


def _where(session: Session) -> TextLike:
    client = session.client
    return client.name if client.local else joined((client.name, client.address), "between_names")


def _session(access: Access, handle: str, who: Principal) -> SelectedAccount | None:
    session = access.sessions.of_handle(handle)
    if session is None:
        return None
    _, touched_s = access.sessions.seen_s(session)
    principal = access.principal(session.client, session.id)
    facts: list[tuple[Text, TextLike]] = [
        (word("role"), _role(principal.role, sorted(principal.groups))),
        (word("where"), _where(session)),
        (word("since"), _since(access, session)),
        (word("touched"), word("ago", age=format_age(touched_s))),
    ]
    about = (principal.role, (), (), False, facts, 0, session.user, _is_here(session, who))
    return SelectedAccount(handle, *about)


def _own_session(access: Access, handle: str, who: Principal) -> SelectedAccount | None:
    session, account = access.sessions.of_handle(handle), _session(access, handle, who)
    return replace(account, title=session.client.title) if session and account else None


def _token_rows(access: Access, _: Principal) -> list[UserRow]:
    return [UserRow(token.name, ROLE_WORDS[token.role]) for token in access.book.tokens]


def _role(role: str, groups: Sequence[str]) -> TextLike:
    return joined((ROLE_WORDS[role], *groups), "between_names")


def _user(access: Access, name: str, _: Principal) -> SelectedAccount | None:
    user = access.book.user(name)
    if user is None:
        return None
    ways = [word(way) for way in WAYS if way in user.ways]
    facts: list[tuple[Text, TextLike]] = [
        (word("role"), _role(user.role, user.groups)),
        (word("ways"), joined(ways, "between_names") if ways else word("none")),
        (word("last"), _time(access.log.last.users.get(user.name, ""))),
        (word("created"), _time(user.created)),
        (word("changed"), _time(user.changed)),
    ]
    version = access.book.version(user.name)
    about = (user.name, user.role, user.groups, user.ways, user.disabled)
    return SelectedAccount(*about, facts, version)


def _token(access: Access, name: str, _: Principal) -> SelectedAccount | None:
    token = next((token for token in access.book.tokens if token.name == name), None)
    if token is None:
        return None
    facts: list[tuple[Text, TextLike]] = [
        (word("role"), ROLE_WORDS[token.role]),
        (word("last_used"), _time(access.log.last.tokens.get(token.name, ""))),
        (word("created"), _time(token.created)),
    ]
    return SelectedAccount(
        token.name, token.role, (), (), False, facts, access.book.version(token.name)
    )


def _time(text: str) -> TextLike:
    """A time of the users' file in the reader's language; "never" for none."""
    if not text:
        return word("never")
    try:
        return format_datetime(datetime.fromisoformat(text).timestamp())
    except ValueError:
        return text


Rows = Callable[[Access, Principal], list[UserRow]]
Details = Callable[[Access, str, Principal], SelectedAccount | None]
LISTS: Final[Mapping[Listed, tuple[Rows, Details]]] = {
    "users": (_user_rows, _user),
    "tokens": (_token_rows, _token),
    "sessions": (_session_rows, _session),
    "own": (_own_rows, _own_session),
}

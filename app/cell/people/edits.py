"""Changes of users and tokens, as the command line and the page of users make them.

Each takes a book and returns another one; UsersError says why it can't be made. No I/O.
"""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import replace
from typing import Any

from app.cell.people.look_alikes import look_alike, mixes_scripts
from app.cell.people.secrets_hash import Cost, Way, badge_hash, hashed
from app.cell.people.users import (
    ApiToken,
    User,
    UserBook,
    UsersError,
    check_group,
    check_name,
    check_role,
    name_key,
)
from app.cell.people.users_file import LastUses
from app.system.texts import say


def known_user(book: UserBook, name: str) -> User:
    """The user of this name, in upper or lower case."""
    user = book.user(name)
    if user is None:
        names = tuple(other.name for other in book.users)
        raise UsersError(say("users_unknown", name=name, names=names or say("users_none")))
    return user


def hashes_of(secrets: Mapping[Way, str], book: UserBook, name: str, cost: Cost) -> dict[Way, str]:
    """The hashes of a user's secrets; UsersError if another user has the badge."""
    hashes: dict[Way, str] = {}
    for way, secret in secrets.items():
        if way == "badge":
            hashes[way] = badge_hash(secret, book.badge_salt)
            other = book.user_of_badge(hashes[way])
            if other is not None and name_key(other.name) != name_key(name):
                raise UsersError(say("users_badge_taken", name=other.name))
        else:
            hashes[way] = hashed(secret, cost)
    return hashes


def add_user(
    book: UserBook,
    name: str,
    role: str,
    groups: Collection[str],
    hashes: Mapping[Way, str],
    now: str,
) -> UserBook:
    check_name(name)
    if not any(hashes.values()):
        raise UsersError(say("users_no_way"))
    if book.user(name) is not None:
        raise UsersError(say("users_exists", name=name))
    _check_look(name, (user.name for user in book.users))
    user = User(name, check_role(role), tuple(map(check_group, groups)))
    return book.with_user(user.with_hashes(hashes), now)


def _check_look(name: str, others: Iterable[str]) -> None:
    """UsersError for a name that a person takes for another one."""
    if mixes_scripts(name):
        raise UsersError(say("users_name_mixed", name=name))
    if other := look_alike(name, others):
        raise UsersError(say("users_name_alike", name=name, other=other))


def set_role(
    book: UserBook, name: str, role: str, groups: Collection[str] | None, now: str
) -> UserBook:
    """`groups`: None for those that the user has."""
    user = known_user(book, name)
    kept = user.groups if groups is None else tuple(map(check_group, groups))
    return book.with_user(replace(user, role=check_role(role), groups=kept), now)


def set_secrets(book: UserBook, name: str, hashes: Mapping[Way, str], now: str) -> UserBook:
    """Other hashes; "" removes a way to sign in."""
    changed = known_user(book, name).with_hashes(hashes)
    if not changed.ways:
        raise UsersError(say("users_last_way", name=changed.name))
    return book.with_user(changed, now)


def set_disabled(book: UserBook, name: str, disabled: bool, now: str) -> UserBook:
    return book.with_user(replace(known_user(book, name), disabled=disabled), now)


def remove_user(book: UserBook, name: str) -> UserBook:
    return book.without_user(known_user(book, name).name)


def open_panel(book: UserBook) -> UserBook:
    """Without users and tokens: everyone may do everything."""
    return replace(book, users=(), tokens=())


def add_token(book: UserBook, name: str, role: str, token_hash: str, now: str) -> UserBook:
    check_name(name, "token")
    if any(known.name == name for known in book.tokens):
        raise UsersError(say("users_token_exists", name=name))
    _check_look(name, (known.name for known in book.tokens))
    token = ApiToken(name, check_role(role), token_hash, now)
    return replace(book, tokens=(*book.tokens, token))


def revoke_token(book: UserBook, name: str) -> UserBook:
    left = tuple(token for token in book.tokens if token.name != name)
    if len(left) == len(book.tokens):
        names = tuple(token.name for token in book.tokens)
        raise UsersError(say("users_token_unknown", name=name, names=names or say("users_none")))
    return replace(book, tokens=left)


def keeps_engineer(before: UserBook, after: UserBook) -> UserBook:
    """`after`; UsersError if it takes the last user who could change users at the panel, or adds others
    before there is one."""
    if not after.engineers and (before.engineers or len(after.users) > len(before.users)):
        raise UsersError(say("users_last_engineer" if before.engineers else "users_first_engineer"))
    return after


# Users and tokens as programs get them, without hashes.


def users_json(book: UserBook, last: LastUses) -> list[dict[str, Any]]:
    """The users; `last_sign_in` is ISO 8601, None for never or unknown."""
    return [
        {
            "name": user.name,
            "role": user.role,
            "groups": list(user.groups),
            "signs_in_with": list(user.ways),
            "disabled": user.disabled,
            "created": user.created,
            "changed": user.changed,
            "last_sign_in": last.users.get(user.name),
        }
        for user in book.users
    ]


def tokens_json(book: UserBook, last: LastUses) -> list[dict[str, Any]]:
    """The tokens; `last_used` is ISO 8601 in whole hours, None for never or unknown."""
    return [
        {
            "name": token.name,
            "role": token.role,
            "created": token.created,
            "last_used": last.tokens.get(token.name),
        }
        for token in book.tokens
    ]

"""Users and tokens as programs get them, without hashes."""

from typing import Any

from app.access.access_log import LastUses
from app.access.users import UserBook


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

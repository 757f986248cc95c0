"""Who may do what, as text for the operator's log: names, roles and groups, and nothing by which one
signs in."""

from collections.abc import Iterator, Mapping
from pathlib import Path

from app.access.users import ApiToken, User, UserBook, UsersError
from app.access.users_file import NAME, UsersFile


def read_rights(folder: Path) -> Mapping[str, str]:
    """`user Ada` or `token mes` → role, groups, ways to sign in, of the users' file in this folder. A
    file that can't be read has the error. Blocks."""
    try:
        return dict(rights_of_all(UsersFile(folder).read()))
    except (UsersError, OSError) as error:
        return {NAME: f"unreadable: {error}"}


def rights_of_all(book: UserBook) -> Iterator[tuple[str, str]]:
    """The name and the rights of each user and token, by name."""
    for user in sorted(book.users, key=lambda user: user.name):
        yield f"user {user.name}", _of_user(user)
    for token in sorted(book.tokens, key=lambda token: token.name):
        yield f"token {token.name}", _of_token(token)


def _of_user(user: User) -> str:
    parts = [user.role, *sorted(user.groups)]
    if user.ways:
        parts.append(f"by {' or '.join(user.ways)}")
    return ", ".join([*parts, *(["disabled"] if user.disabled else [])])


def _of_token(token: ApiToken) -> str:
    return token.role

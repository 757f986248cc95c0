"""Who presses: a client, and the user who is logged in there."""

from dataclasses import dataclass

from app.i18n import TextLike, render
from app.permission.clients import Client
from app.roles import ENGINEER, meets


@dataclass(frozen=True, slots=True)
class Principal:
    """Who asks for something: permissions, limits and log entries are per principal.

    `client` is the browser or program. `user` is the name of the user who is signed in, "" for nobody.
    `role` is one of `ROLES`, `groups` are the panel's own groups that the user is in. While there are
    no users, everybody is an engineer. `program`: it has a token, and no person is there.
    """

    client: Client
    user: str = ""
    role: str = ENGINEER
    groups: frozenset[str] = frozenset()
    program: bool = False

    def meets(self, needs: str) -> bool:
        """Whether this principal has the role or is in the group `needs`; "" needs nothing."""
        return meets(needs, self.role, self.groups)

    @property
    def name(self) -> TextLike:
        """As the operator's log names them: the user, else the client."""
        return self.user or self.client.name

    @property
    def title(self) -> TextLike:
        """The name at the start of a sentence."""
        return self.user or self.client.title

    def __str__(self) -> str:
        return f"{render(self.name)} ({self.client.address})"

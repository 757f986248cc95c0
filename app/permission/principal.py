"""Who presses: a client, the user who is logged in there, and the user's role."""

from dataclasses import dataclass
from typing import Literal

from app.i18n import TextLike, render
from app.permission.clients import Client

UserRole = Literal["operator"]


@dataclass(frozen=True, slots=True)
class Principal:
    """Who asks for something: permissions, limits and log entries are per principal.

    `client` is the browser or program. `user` is the name of the user who is logged in, "" while there
    are no users; then everyone is an operator.
    """

    client: Client
    user: str = ""
    role: UserRole = "operator"

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

"""The act by which an engineer's panel file takes the place of the one in force: `take`.

`ActRequest.values` has `sent`, the hash of what was checked, and `compared`, the hash of what it was
compared with. The server starts again when the act is in the log; until then it refuses every command.
"""

from collections.abc import Mapping
from typing import Final, Protocol

from app.cell.commands.acts import Act, ActRequest, Applied, server_permits
from app.panel.roles import ENGINEER
from app.records.principal import Principal
from app.system.texts import Text, TextLike, say

TAKE: Final = "take"


class PanelTaker(Protocol):
    """What takes a panel file for a server."""

    def obstacle(self, who: Principal) -> Text | None:
        """Why no other panel can be taken now; None if one can."""

    def lock(self) -> None:
        """Refuses every command from now on."""

    async def take(self, request: ActRequest) -> Text | None:
        """Writes the files; why it could not. Commands are permitted again if it changed nothing."""


def _take(taker: PanelTaker, request: ActRequest) -> Applied:
    if (obstacle := taker.obstacle(request.who)) is not None:
        return Applied(obstacle)
    taker.lock()
    return Applied(
        waits=True,
        finish=lambda: taker.take(request),
        fails_by="interlock",
        note=_note(request),
    )


def _note(request: ActRequest) -> TextLike:
    values = request.values
    return say("panel_taken", old=values["compared"][:12], new=values["sent"][:12])


PANEL_ACTS: Final[Mapping[str, Act[PanelTaker, Applied]]] = {
    TAKE: Act("log_page_panel_take", server_permits, _take, lambda applied: applied.note, ENGINEER),
}

"""The act on the notice of a newer release: it is postponed. Installing and rolling back are commands
of an engineer on the PC: the server may not change it."""

import time
from collections.abc import Callable, Mapping
from typing import Final, Protocol

from app.cell.commands.acts import Act, ActRequest, ActRunner, Applied, Finish, server_permits
from app.cell.view.machine_status import Machine, Postponed
from app.panel.roles import ENGINEER
from app.records.press_record import origin_of
from app.system.clock import format_datetime
from app.system.texts import say

MOST_DAYS: Final = 30
DAY_S: Final = 86_400


class Watch(Protocol):
    """What watches the machine."""

    now: Machine

    def postpone(self, postponed: Postponed) -> Finish:
        """Shows the notice later, and keeps that over a restart."""


def _postpone(watch: "Watching", request: ActRequest) -> Applied:
    """`request.object` is the version, `days` of its values for how long."""
    watching = watch()
    release = watching.now.release if watching is not None else None
    if watching is None or release is None or release.version != request.object:
        return Applied(say("release_gone", version=request.object))
    days = request.values.get("days", 1)
    by = origin_of(request.who).who
    postponed = Postponed(release.version, time.time() + days * DAY_S, by)
    until = format_datetime(postponed.until)
    note = say("release_done_postpone", version=release.version, until=until)
    return Applied(finish=watching.postpone(postponed), note=note)


Watching = Callable[[], Watch | None]
MachineRunner = ActRunner[Watching]
MACHINE_ACTS: Final[Mapping[str, Act[Watching, Applied]]] = {
    "postpone": Act(
        "log_page_diagnostics_postpone", server_permits, _postpone, lambda done: done.note, ENGINEER
    )
}

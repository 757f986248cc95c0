"""Acts of the shift report: the row of a message to the next shift.

`ActRequest.values` has its `text`. The message is only in the operator's log, in the entry of its act.
"""

from collections.abc import Mapping
from typing import Final

from app.cell.commands.acts import Act, ActRequest, Applied, server_permits
from app.system.texts import say

LONGEST_MESSAGE: Final = 400
SHIFT_ACTION: Final = "alarm_message"  # of its entries


def _leave(_: None, request: ActRequest) -> Applied:
    """The entry of the act is the message."""
    text = str(request.values.get("text", "")).strip()
    return Applied(None if text else say("alarms_message_empty"))


SHIFT_ACTS: Final[Mapping[str, Act[None, Applied]]] = {
    "message": Act("log_page_alarm_message", server_permits, _leave, lambda _: say("log_done_message")),
}

"""The receipt of an act on this server's own state."""

from dataclasses import dataclass

from app.errors import Cause
from app.i18n import TextLike
from app.robot.command_status import OutcomeCode


@dataclass(frozen=True, slots=True)
class ActReceipt:
    """The result of an act: `code` names why it was refused, `reason` is the sentence for the operator,
    and `cause` decides the HTTP status. All are "" if the act was applied, except that `reason` may
    then say that the act is not safely in the log. `at` is RFC 3339."""

    id: str
    act: str
    outcome: OutcomeCode
    code: str
    reason: TextLike
    at: str
    cause: Cause

    @property
    def done(self) -> bool:
        return self.outcome != "refused"

    def as_json(self) -> dict[str, TextLike]:
        return {
            "id": self.id,
            "act": self.act,
            "outcome": self.outcome,
            "code": self.code,
            "reason": self.reason,
            "at": self.at,
        }

"""What permission is judged to be: permitted, or locked with a reason."""

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Final

from app.i18n import TextLike, ended, joined, say


@dataclass(frozen=True, slots=True)
class Verdict:
    """`reason` is None when permitted; `code` is its stable name; `until` (monotonic seconds) is
    when time alone would change the verdict. `others` are further verdicts that lock the same."""

    permitted: bool
    code: str = "permitted"
    reason: TextLike | None = None
    until: float = math.inf
    others: tuple["Verdict", ...] = ()

    @property
    def reasons(self) -> list[TextLike]:
        """All reasons of a lock, each sentence once."""
        reasons = (verdict.reason for verdict in (self, *self.others))
        return list(dict.fromkeys(reason for reason in reasons if reason))


PERMITTED: Final = Verdict(True)
# Of a stop that a client without control presses: the operator's log says so.
WITHOUT_CONTROL: Final = Verdict(True, "permitted_without_control")
PERMITTED_CODES: Final = frozenset({PERMITTED.code, WITHOUT_CONTROL.code})


@lru_cache(maxsize=256)
def locked(code: str, **about: TextLike) -> Verdict:
    """The verdict for a sentence; the same one again for the same."""
    return Verdict(False, code, say(code, **about))


@lru_cache(maxsize=256)
def with_advice(verdict: Verdict, advice: TextLike) -> Verdict:
    """A lock whose reason goes on with what to do; the same one again for the same."""
    if verdict.permitted:
        return verdict
    return replace(verdict, reason=joined((ended(verdict.reason or ""), advice)))

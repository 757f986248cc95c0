"""The query of the shift report: of which time it is."""

from collections.abc import Sequence
from typing import Annotated, Final, Literal

from pydantic import BaseModel, ConfigDict, Field

from app.alarms.shifts import Shift, shift_at
from app.web.typed_times import TypedTime, typed_ms

DAY_S: Final = 86_400.0
SHIFTS: Final = ("this", "last", "previous")


class ReportQuery(BaseModel):
    """The time of the report: a shift, or from `since` on and before `until` if one of these is there.
    `robot` is the one whose states are shown, by default the first."""

    model_config = ConfigDict(extra="forbid")

    shift: Literal["this", "last", "previous"] = "this"
    since: TypedTime = ""
    until: TypedTime = ""
    robot: Annotated[str, Field(max_length=64)] = ""
    act: Annotated[str, Field(max_length=400)] = ""

    @property
    def has_times(self) -> bool:
        return bool(self.since or self.until)

    def times(self, now: float, starts: Sequence[str]) -> Shift:
        """From when to when; InputError for what is no time. Without a beginning the time is a day
        long, and without an end it ends now."""
        if not self.has_times:
            return shift_at(now, starts, SHIFTS.index(self.shift))
        since, until = typed_ms("since", self.since), typed_ms("until", self.until, fold=1)
        end = now if until is None else until / 1000
        return Shift(end - DAY_S if since is None else since / 1000, end)

    def before(self, now: float, starts: Sequence[str]) -> Shift:
        """The time before that, of the same length, or the shift before."""
        if not self.has_times:
            return shift_at(now, starts, SHIFTS.index(self.shift) + 1)
        since, until = self.times(now, starts)
        return Shift(since - (until - since), since)

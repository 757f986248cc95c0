"""The result of a proof: its cases, each with what was found."""

from dataclasses import dataclass, field
from typing import Final, Literal, NamedTuple

Kind = Literal["simulated", "live"]
NOT_REACHED: Final = "its step was not reached"


class Result(NamedTuple):
    """A case with its result: `fault` is "" where it holds. `took_s` is how long the page took to
    show it, or a hold to stop, None where nothing was timed; of a live proof it is the time since the
    step began. `shown` is the reason on the page, or what the panel measured. `by`, `at` (RFC 3339)
    and `remark` are those of the person who watched, "" without one. `robot` is the id of one of
    several."""

    kind: str  # "control", "hold" or "alarm"
    name: str
    guard: str
    situation: str
    fault: str
    took_s: float | None = None
    shown: str = ""
    robot: str = ""
    by: str = ""
    at: str = ""
    remark: str = ""


@dataclass
class Proof:
    """What was proved, and how long it took; `left_out` has why something was not. `missing` is the
    number of steps of a live proof that were not reached."""

    results: list[Result] = field(default_factory=list)
    left_out: dict[str, str] = field(default_factory=dict)
    took_s: float = 0.0
    browser: str = ""  # in which the pages were looked at, "" for none
    kind: Kind = "simulated"
    server: str = ""  # whose panel was watched
    missing: int = 0

    @property
    def faults(self) -> list[Result]:
        return [result for result in self.results if result.fault]

    @property
    def holds(self) -> bool:
        return bool(self.results) and not self.faults and not self.missing

    @property
    def watchers(self) -> list[str]:
        """The persons who watched, in the order of their first case."""
        return list(dict.fromkeys(result.by for result in self.results if result.by))

"""What a plan consists of."""

from collections.abc import Callable, Iterator, Sequence
from typing import Protocol

from app.install.host import Host
from app.install.system import Unit


class InstallStep(Protocol):
    """One thing that is so when it is done. `do` and `undo` may be repeated."""

    def describe(self, host: Host) -> str:
        """What `do` does, in the imperative."""

    def is_done(self, host: Host) -> bool: ...

    def do(self, host: Host) -> None:
        """StepFailed if it can't be done."""

    def undo(self, host: Host) -> str:
        """Takes it back; returns what was done, "" for nothing."""


def describe(steps: Sequence[InstallStep], host: Host) -> Iterator[str]:
    """A line for each step: what it would do, or that it is done."""
    for step in steps:
        yield f"{'done' if step.is_done(host) else 'to do':5}  {step.describe(host)}"


def apply(steps: Sequence[InstallStep], host: Host, say: Callable[[str], object]) -> int:
    """Does the steps that are not done, in their order; returns how many there were. A unit that
    runs is started again after any of them, so that it has what they changed."""
    done = 0
    for step in steps:
        if (done and isinstance(step, Unit)) or not step.is_done(host):
            say(step.describe(host))
            step.do(host)
            done += 1
    return done


def revert(steps: Sequence[InstallStep], host: Host, say: Callable[[str], object]) -> None:
    """Takes the steps back, the last first."""
    for step in reversed(steps):
        if said := step.undo(host):
            say(said)

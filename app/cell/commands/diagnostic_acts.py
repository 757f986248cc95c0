"""Acts of the page of diagnostics: the rows of a check by the doctor, of the support bundle, and of a
recording that is shared with Foxglove."""

from collections.abc import Callable, Mapping
from typing import Final, Protocol

from app.cell.commands.acts import Act, ActRequest, Applied, server_permits
from app.panel.roles import MAINTENANCE
from app.system.texts import say


class Doctor(Protocol):
    """What checks the panel, this machine and the robot."""

    @property
    def is_busy(self) -> bool:
        """Whether it checks, or collects a bundle."""

    def begin_check(self) -> None:
        """Begins a check, which takes some seconds."""


class NoDoctor:
    """For sessions that no server has, such as those of tests."""

    is_busy = True

    def begin_check(self) -> None:
        """Is never called: it is busy."""


def _check(doctor: Doctor, _: ActRequest) -> Applied:
    if not doctor.is_busy:
        doctor.begin_check()
    return Applied(waits=True)


def _bundle(doctor: Doctor, _: ActRequest) -> Applied:
    """The caller collects it once the act is logged."""
    return Applied(say("diagnostics_busy") if doctor.is_busy else None)


def _share(_: Doctor, __: ActRequest) -> Applied:
    """The caller shares the recording once the act is logged."""
    return Applied()


def _row(word: str, apply: Callable[[Doctor, ActRequest], Applied], code: str) -> Act[Doctor, Applied]:
    return Act(word, server_permits, apply, lambda _: say(code), MAINTENANCE)


DIAGNOSTIC_ACTS: Final[Mapping[str, Act[Doctor, Applied]]] = {
    "check": _row("log_page_diagnostics_check", _check, "log_done_check"),
    "bundle": _row("log_page_diagnostics_bundle", _bundle, "log_done_bundle"),
    "foxglove": _row("log_page_diagnostics_foxglove", _share, "log_done_foxglove"),
}

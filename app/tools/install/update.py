"""Another release in place of the one that runs, and back if it does not come up."""

import time
import urllib.error
import urllib.request
from collections.abc import Callable
from dataclasses import dataclass
from http.client import HTTPException
from io import BytesIO
from pathlib import Path
from typing import Final, Protocol

from app.system.errors import SettingsError
from app.tools.install.host import Host, StepFailed
from app.tools.install.plan import PANEL, ROUTER, SCREEN, SERVER, own_files, router_unit
from app.tools.install.release import (
    Assets,
    CheckedPanel,
    Current,
    Release,
    forget,
    link_to,
    linked,
    remove_old,
    wheel_in,
)
from app.tools.install.steps import apply

UNITS: Final = "/etc/systemd/system"
COMES_WITHIN_S: Final = 60.0
STAYS_S: Final = 3.0
POLL_S: Final = 0.5
RESPONDS_WITHIN_S: Final = 5.0
URL: Final = "http://127.0.0.1:8000"
# The server is on this machine: a proxy of the environment is not for it.
DIRECT: Final = urllib.request.build_opener(urllib.request.ProxyHandler({}))
Say = Callable[[str], object]


class Services(Protocol):
    def restart(self) -> None:
        """Starts the server, and the screen if there is one, from the files as they are now."""


@dataclass(frozen=True, slots=True)
class SystemdServices:
    host: Host

    def restart(self) -> None:
        if not self.host.runs_systemd:
            return
        self.host.run(["systemctl", "daemon-reload"])
        # Stopped first, and waited for: what answers after it is the other release.
        self.host.run(["systemctl", "stop", SERVER])
        self.host.run(["systemctl", "start", "--no-block", SERVER])
        self.host.run(["systemctl", "try-restart", "--no-block", SCREEN])


@dataclass(frozen=True, slots=True, kw_only=True)
class Updater:
    """`url` is None if no server runs from the files, as in a folder that becomes a machine."""

    host: Host
    services: Services
    url: str | None
    say: Say
    comes_within_s: float = COMES_WITHIN_S
    stays_s: float = STAYS_S

    def update(self, wheel: Path, wheels: Path | None = None) -> None:
        """Installs `wheel` and runs it. If it can't be started, or its server or page does not come up,
        the release of before runs again. StepFailed with the reason."""
        lock = Assets(wheel).text("deploy/requirements.lock")
        release = Release(wheel=wheel, lock=lock, wheels=wheels)
        if linked(self.host, "current") == release.name:
            self.say(f"{release.name} runs already")
            return
        apply([release, CheckedPanel(release.name, PANEL)], self.host, self.say)
        self._switch(release.name)

    def back(self) -> None:
        """Runs the release of before again; StepFailed if there is none."""
        before = linked(self.host, "previous")
        if not before:
            raise StepFailed("there is no release before this one")
        self._switch(before)

    def _switch(self, name: str) -> None:
        before, older = linked(self.host, "current"), linked(self.host, "previous")
        was_ready = self._status("/readyz") == 200
        reason = self._start(name, was_ready)
        if not reason:
            remove_old(self.host)
            self.say(f"{name} runs")
            return
        if not before:
            raise StepFailed(f"{name} does not come up: {reason}")
        self.say(f"{name} does not come up ({reason}): {before} is started again")
        again = self._start(before, was_ready)
        forget(self.host, name)
        if older and older != name:
            link_to(self.host, "previous", older)
        end = f"; nor does {before}: {again}" if again else f": {before} runs again"
        raise StepFailed(f"{name} does not come up: {reason}{end}")

    def _start(self, name: str, was_ready: bool) -> str:
        """Starts a release; why it is not good, "" if it is."""
        screen = self.host.files.exists(f"{UNITS}/{SCREEN}")
        try:
            assets = Assets(BytesIO(wheel_in(self.host, name)))
            files = own_files(assets, screen)
            if self.host.files.exists(f"{UNITS}/{ROUTER}"):
                files.append(router_unit(assets))
            apply([*files, Current(name, removes_old=False)], self.host, self.say)
            self.services.restart()
        except (SettingsError, OSError) as error:
            return str(error)
        return self._missing_in_time(was_ready)

    def _missing_in_time(self, was_ready: bool) -> str:
        """What does not come up, "" for nothing. A robot that was off before may be off after."""
        if self.url is None:
            return ""
        end = time.monotonic() + self.comes_within_s
        while reason := self._missing(was_ready):
            if time.monotonic() > end:
                return f"{reason} within {self.comes_within_s:g} s"
            time.sleep(POLL_S)
        time.sleep(self.stays_s)
        reason = self._missing(was_ready)
        return f"{reason} any more" if reason else ""

    def _missing(self, was_ready: bool) -> str:
        if self._status("/healthz") != 200:
            return "the server does not answer"
        if self._status("/", shows=b"data-widget") != 200:
            return "its page does not come"
        if was_ready and self._status("/readyz") != 200:
            return "/readyz is not 200 as it was before"
        return ""

    def _status(self, path: str, shows: bytes = b"") -> int:
        """The status of a response, 0 without one or if it does not have what it shows."""
        if self.url is None:
            return 0
        try:
            with DIRECT.open(f"{self.url}{path}", timeout=RESPONDS_WITHIN_S) as response:
                return int(response.status) if shows in response.read() else 0
        except urllib.error.HTTPError as error:
            return error.code
        except (OSError, HTTPException):
            return 0

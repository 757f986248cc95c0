"""The Zenoh router of a robot whose nodes run on rmw_zenoh: its unit and its configuration, in place of
those of a bridge.

Read with Python's own TOML: the command runs from the wheel's file, with nothing installed.
"""

import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from app.dialect.dialect import WITHOUT_BRIDGE
from app.install.assets import Assets
from app.install.files import OwnFile, has_content
from app.install.host import Host
from app.install.panel_files import users_file
from app.install.release import RELEASES
from app.install.step import InstallStep
from app.install.system import Unit

ROUTER: Final = "operator-panel-router.service"
CONFIG: Final = "/etc/operator-panel/router.json5"
PROGRAMS: Final = ("/usr/local/bin/zenohd", "/usr/bin/zenohd")


def needs_router(panel: Path | None) -> bool:
    """Whether the robot of a panel file is said to be on rmw_zenoh. Not where a panel has several: each
    has a router of its own. A file that is no TOML says nothing: its check says what is wrong."""
    try:
        tables = tomllib.loads(users_file(panel).decode()) if panel else {}
    except (tomllib.TOMLDecodeError, UnicodeDecodeError):
        return False
    robots = tables.get("robot", [tables])
    return len(robots) == 1 and robots[0].get("dialect") in WITHOUT_BRIDGE


def router_steps(assets: Assets, release: str, panel: str, host: Host) -> Iterator[InstallStep]:
    """The unit and the configuration for an installed panel file; the unit is started where zenohd is
    there."""
    yield router_unit(assets)
    yield RouterConfig(release, panel)
    if any(map(host.files.exists, PROGRAMS)):
        yield Unit(ROUTER)


def router_unit(assets: Assets) -> OwnFile:
    return OwnFile(
        path=f"/etc/systemd/system/{ROUTER}",
        content=assets.text(f"deploy/{ROUTER}"),
        about="the unit of the robot's Zenoh router",
    )


@dataclass(frozen=True, slots=True)
class RouterConfig:
    """The router's configuration, by a release's own command: written again when it differs."""

    release: str
    panel: str

    def _command(self) -> list[str]:
        return [f"{RELEASES}/{self.release}/bin/operator-panel", "router-config", self.panel]

    def describe(self, host: Host) -> str:
        return f"write {CONFIG} (what the panel may send through the router)"

    def is_done(self, host: Host) -> bool:
        return host.files.exists(self._command()[0]) and has_content(host, CONFIG, self._text(host))

    def do(self, host: Host) -> None:
        host.files.write(CONFIG, self._text(host))

    def undo(self, host: Host) -> str:
        if not host.files.is_file(CONFIG):
            return ""
        host.files.remove(CONFIG)
        return f"removed {CONFIG}"

    def _text(self, host: Host) -> bytes:
        return host.run(self._command()).encode()

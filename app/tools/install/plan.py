"""The steps of an installation, in their order."""

import re
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Final

from app.ros.dialects.dialect import WITHOUT_BRIDGE
from app.system.errors import SettingsError
from app.system.minisign import PINNED, parse_keys
from app.tools.install.host import Host, release_of
from app.tools.install.panel_files import copies_for, users_file
from app.tools.install.release import (
    RELEASES,
    Assets,
    CheckedPanel,
    Current,
    Release,
    own_wheel,
)
from app.tools.install.steps import (
    InstallStep,
    Masked,
    OwnFile,
    Packages,
    Unit,
    User,
    UsersFile,
    has_content,
)

# The Zenoh router of a robot whose nodes run on rmw_zenoh: its unit and its configuration, in place of
# those of a bridge.
#
# Read with Python's own TOML: the command runs from the wheel's file, with nothing installed.

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


SYSTEMS: Final = {("debian", "12"), ("debian", "13"), ("ubuntu", "24.04")}
ETC: Final = "/etc/operator-panel"
PANEL: Final = f"{ETC}/panel.toml"
SERVER: Final = "operator-panel.service"
SCREEN: Final = "operator-panel-kiosk.service"
USER: Final = "operator-kiosk"
TOUCH_RULE: Final = "/etc/udev/rules.d/90-operator-panel-touch.rules"
# Where Chromium and Chrome read what their users may do.
POLICIES: Final = (
    "/etc/chromium/policies/managed/operator-panel.json",
    "/etc/opt/chrome/policies/managed/operator-panel.json",
)
ALWAYS: Final = ("python3-venv",)
FOR_THE_SCREEN: Final = (
    "sway",
    "seatd",
    "swayidle",
    "libgl1-mesa-dri",
    "fonts-noto-core",
    "fonts-noto-cjk",
)
CHROMIUM: Final = "chromium"
# Not a snap: that one has no access to the unit's folders and its DevTools pipe.
OTHER_BROWSERS: Final = ("/usr/bin/google-chrome-stable", "/usr/bin/chromium")
NUMBER: Final = re.compile(r"-?\d+(\.\d+)?")


@dataclass(frozen=True, slots=True, kw_only=True)
class Options:
    """What is installed. `touch_matrix` has six numbers of libinput's calibration matrix, or none."""

    wheel: Path
    panel: Path | None = None
    zenoh: Path | None = None
    wheels: Path | None = None
    screen: bool = True
    touch_matrix: tuple[str, ...] = ()
    any_system: bool = False
    key: Path | None = None


def steps(options: Options, host: Host) -> list[InstallStep]:
    """All steps; SettingsError if this system or an option can't be used."""
    assets = Assets(options.wheel)
    release = Release(
        wheel=options.wheel, lock=assets.text("deploy/requirements.lock"), wheels=options.wheels
    )
    return [
        Packages(_packages(options, host)),
        release,
        UsersFile(
            path=PANEL,
            content=_content(options.panel, assets, "panel.toml"),
            about=str(options.panel or "the shipped panel with a simulated robot"),
            replaces=options.panel is not None,
        ),
        UsersFile(
            path=f"{ETC}/zenoh.json5",
            content=_content(options.zenoh, assets, "zenoh.json5"),
            about=str(options.zenoh or "how the robot's bridge is reached"),
            replaces=options.zenoh is not None,
        ),
        *(copies_for(options.panel, ETC) if options.panel else ()),
        *([_pinned(options.key)] if options.key else ()),
        CheckedPanel(release.name, PANEL),
        Current(release.name),
        *own_files(assets, options.screen),
        *(router_steps(assets, release.name, PANEL, host) if needs_router(options.panel) else ()),
        *(_of_the_screen(options, assets) if options.screen else []),
        Unit(SERVER),
        *([Unit(SCREEN)] if options.screen else []),
    ]


def _pinned(key: Path) -> UsersFile:
    """The public key of the releases; SettingsError if the file has none."""
    text = users_file(key).decode("utf-8", "replace")
    names = ", ".join(each.name for each in parse_keys(text, str(key)))
    return UsersFile(path=PINNED, content=text, about=f"updates are signed with {names}", replaces=True)


def own_files(assets: Assets, screen: bool) -> list[InstallStep]:
    """The files that each release has its own of."""
    unit = "/etc/systemd/system"
    files: list[InstallStep] = [
        OwnFile(
            path=f"{unit}/{SERVER}", content=assets.text(f"deploy/{SERVER}"), about="the server's unit"
        )
    ]
    if screen:
        policies = assets.text("deploy/kiosk-policies.json")
        files += [OwnFile(path=path, content=policies, about="no way out of it") for path in POLICIES]
        content = assets.text(f"deploy/{SCREEN}")
        files.append(OwnFile(path=f"{unit}/{SCREEN}", content=content, about="the screen's unit"))
    return files


def _of_the_screen(options: Options, assets: Assets) -> list[InstallStep]:
    users = "/etc/sysusers.d/operator-panel.conf"
    steps: list[InstallStep] = [
        OwnFile(path=users, content=assets.text("deploy/sysusers.conf"), about="the browser's user"),
        User(USER, users),
        UsersFile(
            path=f"{ETC}/kiosk.toml", content=assets.text("deploy/kiosk.toml"), about="the screen"
        ),
        Masked(unit="ctrl-alt-del.target", about="the keys that restart the machine"),
    ]
    if options.touch_matrix:
        rule = touch_rule(options.touch_matrix)
        steps.append(OwnFile(path=TOUCH_RULE, content=rule, about="the touch screen's calibration"))
    return steps


def uninstall_steps(host: Host) -> list[InstallStep]:
    """All that an installation may have made."""
    here = Path(__file__)  # the names of files count here, not what is in them
    return [
        Packages([*ALWAYS, *FOR_THE_SCREEN, CHROMIUM]),
        Release(wheel=here, lock=""),
        *(
            UsersFile(path=f"{ETC}/{name}", content="", about="")
            for name in ("panel.toml", "zenoh.json5", "kiosk.toml", PurePosixPath(PINNED).name)
        ),
        *own_files(Assets(own_wheel()), screen=True),
        router_unit(Assets(own_wheel())),
        RouterConfig("", PANEL),
        OwnFile(path="/etc/sysusers.d/operator-panel.conf", content="", about=""),
        User(USER, ""),
        Masked(unit="ctrl-alt-del.target", about=""),
        OwnFile(path=TOUCH_RULE, content="", about=""),
        Unit(SERVER),
        Unit(SCREEN),
        Unit(ROUTER),
    ]


def touch_rule(matrix: tuple[str, ...]) -> str:
    """A rule for udev, with libinput's calibration matrix."""
    if len(matrix) != 6 or not all(map(NUMBER.fullmatch, matrix)):
        raise SettingsError(
            f'--touch-matrix is "{" ".join(matrix)}": six numbers, such as "1 0 0 0 1 0"'
        )
    return (
        "# Touch calibration: see docs/how-to/kiosk.md\n"
        'SUBSYSTEM=="input", KERNEL=="event*", ENV{ID_INPUT_TOUCHSCREEN}=="1", '
        f'ENV{{LIBINPUT_CALIBRATION_MATRIX}}="{" ".join(matrix)}"\n'
    )


def _packages(options: Options, host: Host) -> list[str]:
    system = release_of(host)
    if system not in SYSTEMS and not options.any_system:
        name = " ".join(filter(None, system)) or "this system"
        raise SettingsError(
            f"{name} is not supported: Debian 12, 13 or Ubuntu 24.04 (--any-system goes on anyway)"
        )
    names = [*ALWAYS, *(FOR_THE_SCREEN if options.screen else ())]
    if not options.screen or any(map(host.files.exists, OTHER_BROWSERS)):
        return names
    if system[0] == "ubuntu":
        raise SettingsError(
            "there is no browser: Ubuntu's Chromium is a snap, which a service of its own user can't"
            " run. Install Google Chrome's Debian package (google-chrome-stable), then run this again"
        )
    return [*names, CHROMIUM]


def _content(path: Path | None, assets: Assets, shipped: str) -> str:
    """Of the user's file, else of the shipped one."""
    if path is None:
        return assets.text(shipped)
    try:
        return users_file(path).decode()
    except UnicodeDecodeError as error:
        raise SettingsError(f"{path} can't be read: it is not UTF-8 text") from error

"""The settings, from environment variables."""

import os
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from ipaddress import ip_network
from pathlib import Path
from typing import Annotated, Literal, overload

from app.system.errors import SettingsError
from app.system.public import PUBLIC

Mode = Literal["demo", "live"]

APP = "operator-panel"
PACKAGE = Path(__file__).resolve().parents[1]
LOOPBACK_HOSTS = ("127.0.0.1", "localhost", "[::1]")
ROOT_PATH = re.compile(r"(/[A-Za-z0-9._~-]+)*")
HOST_NAME = re.compile(r"\[[0-9a-f:.]+\]|[a-z0-9._-]+")
SYSLOG = re.compile(r"(\[[0-9a-fA-F:.]+\]|[A-Za-z0-9._-]+)(?::([0-9]{1,5}))?")
ALL_SITES = "*"
SITE = re.compile(r"[^\s/*$?#@,]([^/*$?#\x00-\x1f\x7f,]{0,62}[^\s/*$?#,])?")
SYSLOG_PORT = 6514  # RFC 5425
LOG_LEVELS = ("debug", "info", "warn", "error", "fatal")
PREFIX = "KIOSK_"
VARIABLES = (
    "PANEL",
    "ZENOH",
    "MODE",
    "DATA",
    "HOSTS",
    "PROXIES",
    "ROOT_PATH",
    "LOG_LEVEL",
    "DEV",
    "LOG_COPY",
    "SYSLOG",
    "SYSLOG_CA",
    "FORWARD",
    "WITHOUT",
    "TAKE_PANEL",
    "WALL",
)
PROTECTIONS = ("tls", "users")  # that a server which listens beyond loopback has


def shipped_path(name: str) -> Path:
    """The path of a shipped file or folder: in the installed package, or beside it in a checkout."""
    inside = PACKAGE / name
    return inside if inside.exists() else PACKAGE.parent / name


# Examples that are shipped beside the panel of the package, by name.
SHIPPED_PANELS = {"mobile-robot": "docs/examples/mobile-robot/panel.toml"}


def panel_path(name: str) -> Path:
    """The path of a panel file, or of a shipped panel by its name, if no file has that name."""
    path = Path(name).expanduser()
    is_shipped = name in SHIPPED_PANELS and not path.is_file()
    return shipped_path(SHIPPED_PANELS[name]) if is_shipped else path


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """The values of the `KIOSK_…` variables; see docs/reference/settings.md."""

    panel: Path
    zenoh: Path
    mode: Mode | None = None
    hosts: Annotated[tuple[str, ...], PUBLIC] = LOOPBACK_HOSTS
    proxies: Annotated[tuple[str, ...], PUBLIC] = ()
    root_path: str = ""
    log_level: Annotated[str, PUBLIC] = "info"
    dev: bool = False
    data: Path | None = None
    log_copy: Path | None = None
    syslog: tuple[str, int] | None = None
    syslog_ca: Path | None = None
    forward: Path | None = None
    without: Annotated[tuple[str, ...], PUBLIC] = ()
    take_panel: Annotated[bool, PUBLIC] = False
    wall: tuple[str, ...] | None = None  # the sites of a wall, empty for all; None: a panel

    def data_folder(self, mode: Mode) -> Path:
        """The data folder. Without `KIOSK_DATA` a demo has a folder apart from a live panel's, and a
        shipped example one apart from other demos."""
        if self.data is not None:
            return self.data
        if self.wall is not None:
            return state_home() / APP / "wall"
        if mode != "demo":
            return state_home() / APP
        examples = {shipped_path(file).resolve(): name for name, file in SHIPPED_PANELS.items()}
        example = examples.get(self.panel)
        return state_home() / APP / (f"demo-{example}" if example else "demo")

    @classmethod
    def from_environment(cls, env: Mapping[str, str] = os.environ) -> "Settings":
        """Reads and checks the variables; SettingsError names the variable and what would be right."""
        _check_names(name for name in env if name.startswith(PREFIX))
        level = (env.get("KIOSK_LOG_LEVEL") or "info").lower()
        if level not in LOG_LEVELS:
            raise SettingsError(f'KIOSK_LOG_LEVEL is "{level}": one of {", ".join(LOG_LEVELS)}')
        panel = env.get("KIOSK_PANEL")
        return cls(
            panel=panel_path(panel).resolve() if panel else PACKAGE / "panel.toml",
            zenoh=_parse_path(env, "KIOSK_ZENOH", shipped_path("zenoh.json5")),
            mode=_parse_mode(env.get("KIOSK_MODE", "")),
            hosts=(*LOOPBACK_HOSTS, *_parse_hosts(env.get("KIOSK_HOSTS", ""))),
            proxies=tuple(_parse_proxies(env.get("KIOSK_PROXIES", ""))),
            root_path=parse_root_path(env.get("KIOSK_ROOT_PATH", "")),
            log_level=level,
            dev=env.get("KIOSK_DEV", "") not in ("", "0"),
            data=_parse_path(env, "KIOSK_DATA", None),
            log_copy=_parse_path(env, "KIOSK_LOG_COPY", None),
            syslog=_parse_syslog(env.get("KIOSK_SYSLOG", "")),
            syslog_ca=_parse_path(env, "KIOSK_SYSLOG_CA", None),
            forward=_parse_path(env, "KIOSK_FORWARD", None),
            without=tuple(_parse_without(env.get("KIOSK_WITHOUT", ""))),
            take_panel=env.get("KIOSK_TAKE_PANEL", "") not in ("", "0"),
            wall=_parse_wall(env.get("KIOSK_WALL", "")),
        )


def state_home() -> Path:
    """The user's state folder (XDG Base Directory Specification). A relative path is ignored."""
    path = Path(os.environ.get("XDG_STATE_HOME", ""))
    return path if path.is_absolute() else Path("~/.local/state").expanduser()


def _check_names(variables: Iterable[str]) -> None:
    """SettingsError for an unknown variable: a typing error must not go unnoticed."""
    for variable in variables:
        name = variable.removeprefix(PREFIX)
        if name not in VARIABLES:
            close = get_close_matches(name.upper(), VARIABLES, 1)
            there = ", ".join(PREFIX + known for known in VARIABLES)
            hint = f"did you mean {PREFIX}{close[0]}?" if close else f"there are {there}"
            raise SettingsError(f"{variable} is not a setting of this server: {hint}")


def parse_root_path(text: str) -> str:
    """The path below which a proxy shows the panel, without a slash at its end; "" for none."""
    path = text.rstrip("/")
    if not ROOT_PATH.fullmatch(path) or {".", ".."} & set(path.split("/")):
        raise SettingsError(
            f'KIOSK_ROOT_PATH is "{text}": it must be a path such as /cell1, of letters, digits, ".", '
            '"_", "~" and "-"'
        )
    return path


def _parse_mode(text: str) -> Mode | None:
    match text:
        case "":
            return None
        case "demo" | "live":
            return text
    raise SettingsError(f'KIOSK_MODE is "{text}": it must be "demo" or "live"')


def _split_list(text: str) -> Iterator[str]:
    return filter(None, (part.strip().lower() for part in text.split(",")))


def _parse_hosts(text: str) -> Iterator[str]:
    for host in _split_list(text):
        if not HOST_NAME.fullmatch(host):
            raise SettingsError(
                f'KIOSK_HOSTS has "{host}": names or addresses with commas between, without port '
                "and without http://, an IPv6 address in brackets"
            )
        yield host


def _parse_proxies(text: str) -> Iterator[str]:
    for proxy in _split_list(text):
        try:
            ip_network(proxy)
        except ValueError:
            raise SettingsError(
                f'KIOSK_PROXIES has "{proxy}": addresses or networks with commas between, such as '
                "127.0.0.1 or 192.0.2.0/24"
            ) from None
        yield proxy


def _parse_without(text: str) -> Iterator[str]:
    for protection in _split_list(text):
        if protection not in PROTECTIONS:
            raise SettingsError(
                f'KIOSK_WITHOUT has "{protection}": {" or ".join(PROTECTIONS)}, or both with a comma'
                " between"
            )
        yield protection


def _parse_wall(text: str) -> tuple[str, ...] | None:
    sites = tuple(filter(None, (part.strip() for part in text.split(","))))
    if ALL_SITES in sites:
        return ()
    for site in sites:
        if not SITE.fullmatch(site):
            raise SettingsError(
                f'KIOSK_WALL has "{site}": the names of sites with commas between, as `[site]` of a'
                f' panel file has them, or "{ALL_SITES}" for all'
            )
    return sites or None


def _parse_syslog(text: str) -> tuple[str, int] | None:
    """Host and port; an IPv6 address is in brackets."""
    if not text:
        return None
    match = SYSLOG.fullmatch(text)
    port = int(match[2] or SYSLOG_PORT) if match else 0
    if match is None or not 1 <= port <= 65_535:
        raise SettingsError(
            f'KIOSK_SYSLOG is "{text}": it must be a host and a port such as log.plant:6514; the'
            " messages go over TLS"
        )
    return match[1].strip("[]"), port


@overload
def _parse_path(env: Mapping[str, str], name: str, default: Path) -> Path: ...
@overload
def _parse_path(env: Mapping[str, str], name: str, default: None) -> Path | None: ...
def _parse_path(env: Mapping[str, str], name: str, default: Path | None) -> Path | None:
    text = env.get(name)
    return Path(text).expanduser().resolve() if text else default

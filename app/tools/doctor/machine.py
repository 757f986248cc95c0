"""What this machine has for the panel: addresses and ports, the data folder and disk, screens and
fonts."""

import errno
import json
import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from http.client import HTTPConnection, HTTPException
from pathlib import Path
from typing import Any, Final

from app.panel.checks import fit
from app.panel.model import Panel
from app.panel.widgets.tiles import KEY_MM, Screen
from app.records.data_dir import DataDir
from app.records.room import log_room
from app.system.errors import FolderInUse, LogError, SettingsError
from app.system.process.listen_sockets import check_port_free
from app.system.time_source import TimeSource, read_time_source
from app.tools.doctor.findings import Report

# What this machine has for the panel's server: its address and port, its data folder and disk.

ANSWER_S: Final = 2.0  # for a server on this machine
MB: Final = 1_000_000
OTHER_FILES_MB: Final = 50  # definitions, trends, a log of the time in which the other is pruned
ANYWHERE: Final = {"0.0.0.0": "127.0.0.1", "::": "::1", "": "127.0.0.1"}

# Of `app/web/prometheus.py`: a list of options that is not known.
UNLISTED: Final = re.compile(r'^kiosk_options_known\{robot="([^"]*)",select="([^"]*)"\} 0\.0$', re.M)

FreeBytes = Callable[[Path], int]
ReadTime = Callable[[], TimeSource]


def free_bytes(folder: Path) -> int:
    return shutil.disk_usage(folder).free


def check_port(report: Report, host: str, port: int) -> bool:
    """Whether a server could listen there. Returns whether a panel server is what listens."""
    where = f"{host} port {port}"
    try:
        check_port_free(host, port)
    except SettingsError as error:
        return _not_free(report, host, port, where, error)
    report.fact(f"{where} is free")
    return False


def _not_free(report: Report, host: str, port: int, where: str, error: SettingsError) -> bool:
    cause = error.__cause__ or error.__context__
    if not isinstance(cause, OSError) or cause.errno != errno.EADDRINUSE:
        detail = (getattr(cause, "strerror", None) or str(cause or error)).lower()
        report.find("address_unusable", where, detail=detail)
        return False
    health = ask_server(host, port, "/healthz")
    if health is None or health[0] != 200 or health[1] != {"status": "ok"}:
        report.find("port_in_use", where)
        return False
    report.find("server_running", where)
    ready = ask_server(host, port, "/readyz")
    if ready is not None and ready[0] != 200:
        said = ready[1] if isinstance(ready[1], dict) else {}
        report.find("server_not_ready", where, detail=said.get("reason") or said.get("code", ""))
    elif ready is not None:
        _check_options(report, host, port)
    return True


def _check_options(report: Report, host: str, port: int) -> None:
    """The selects of whose options the running server, which reaches the robot, has no list."""
    metrics = ask_server(host, port, "/metrics")
    text = metrics[1] if metrics is not None and isinstance(metrics[1], str) else ""
    for robot, select in UNLISTED.findall(text):
        report.find("options_unknown", select, robot=robot)


def ask_server(host: str, port: int, path: str) -> tuple[int, Any] | None:
    """(status, JSON or text) of a server on this machine; None where nothing answers by HTTP."""
    connection = HTTPConnection(ANYWHERE.get(host, host), port, timeout=ANSWER_S)
    try:
        connection.request("GET", path, headers={"Host": f"localhost:{port}"})
        answer = connection.getresponse()
        body = answer.read(8 * MB)
    except (OSError, HTTPException):
        return None
    finally:
        connection.close()
    try:
        return answer.status, json.loads(body)
    except ValueError:
        return answer.status, body.decode(errors="replace")


def check_data(
    report: Report, folder: Path, panel: Panel | None, served: bool, free: FreeBytes = free_bytes
) -> None:
    """Whether the server can keep its files. `served`: a server runs, which may have the folder."""
    place = next((parent for parent in (folder, *folder.parents) if os.path.lexists(parent)), folder)
    try:
        with tempfile.TemporaryFile(dir=place):
            pass
    except OSError as error:
        detail = (error.strerror or str(error)).lower()
        report.find("data_unwritable", str(folder), detail=f"{place}: {detail}")
        return
    needed, left = _needed_mb(folder, panel), free(place) // MB
    if left < needed:
        report.find("data_full", str(folder), free_mb=left, needed_mb=needed)
    if not _in_use(report, folder, served):
        report.fact(f"the data folder {folder} can be written, {left} MB are free")


def check_log_room(report: Report, folder: Path, panel: Panel, free: FreeBytes = free_bytes) -> None:
    """Whether the operator's log has room for its days, at its measured rate. Nothing is said of one
    that has less than a day of entries, or can't be read."""
    rules = panel.log
    try:
        room = log_room(folder, rules.days, rules.size_mb, free) if rules.enabled else None
    except (LogError, OSError):
        return
    if room is None:
        return
    figures = {
        "room_mb": f"{room.room_mb:.0f}",
        "needed_mb": f"{room.needed_mb:.0f}",
        "days": f"{room.days:g}",
        "rate": f"{room.entries_per_day:.0f}",
        "kept": f"{room.days_kept:.0f}",
    }
    if room.is_short:
        report.find("log_room", **figures)
    else:
        needed = f"{figures['needed_mb']} of {figures['room_mb']} MB for {figures['days']} days"
        report.fact(f"the operator's log needs {needed} at {figures['rate']} entries a day")


def _needed_mb(folder: Path, panel: Panel | None) -> int:
    """How much the panel's files may still grow."""
    most = float(OTHER_FILES_MB)
    if panel is not None:
        most += panel.log.size_mb if panel.log.enabled else 0
        most += panel.record.max_mb if panel.record is not None else 0
    there = sum(file.stat().st_size for file in folder.rglob("*") if file.is_file())
    return max(OTHER_FILES_MB, int(most) - there // MB)


def _in_use(report: Report, folder: Path, served: bool) -> bool:
    """Whether another server has the folder that is not the one at the panel's port."""
    if served or not (folder / "server.lock").exists():
        return False
    data = DataDir(folder)
    try:
        data.claim()
    except FolderInUse as error:
        report.find("data_in_use", str(folder), detail=str(error))
        return True
    except OSError:
        return False
    data.release()
    return False


def check_time(report: Report, read: ReadTime = read_time_source) -> None:
    """Whether this machine's clock follows a time source."""
    source = read()
    if source.synchronised is None:
        report.find("time_unknown")
    elif source.synchronised:
        report.fact(" by ".join(filter(None, ("this machine's clock is synchronised", source.source))))
    else:
        report.find("time_unsynchronised")


# The sizes of this machine's screens, from their EDID, against what the panel file says of them.
#
# Source: VESA Enhanced EDID Standard 1.4: bytes 21 and 22 are the size in cm, the first detailed timing
# descriptor (from byte 54) has pixels and mm.

DRM: Final = Path("/sys/class/drm")
HEADER: Final = bytes.fromhex("00ffffffffffff00")
TIMING: Final = 54
LEAST_SIZE: Final = 128
TOLERANCE: Final = 0.1  # of the size of a key


@dataclass(frozen=True, slots=True)
class ConnectedScreen:
    """A connected screen: pixels, and mm (0 where it does not say)."""

    name: str
    width: int
    height: int
    width_mm: int
    height_mm: int

    @property
    def mm_per_px(self) -> float:
        return self.width_mm / self.width


def displays(root: Path = DRM) -> Iterator[ConnectedScreen]:
    """The screens that are connected."""
    for folder in sorted(root.glob("card*-*")):
        try:
            connected = (folder / "status").read_text().strip() == "connected"
            edid = (folder / "edid").read_bytes() if connected else b""
        except OSError:
            continue
        name = folder.name.partition("-")[2]
        if (screen := parsed(name, edid)) is not None:
            yield screen


def parsed(name: str, edid: bytes) -> ConnectedScreen | None:
    """What a screen says of itself; None where that is no EDID."""
    if len(edid) < LEAST_SIZE or not edid.startswith(HEADER):
        return None
    timing = edid[TIMING : TIMING + 18]
    width, height = timing[2] | (timing[4] & 0xF0) << 4, timing[5] | (timing[7] & 0xF0) << 4
    if not width or not height:
        return None
    size = timing[12] | (timing[14] & 0xF0) << 4, timing[13] | (timing[14] & 0x0F) << 8
    if not all(size):
        size = edid[21] * 10, edid[22] * 10
    return ConnectedScreen(name, width, height, *(size if all(size) else (0, 0)))


def check_screens(report: Report, panel: Panel, root: Path = DRM) -> None:
    """Whether keys have the size that the panel means, and pages fit. CSS pixels are taken for those of
    the screen: a browser that zooms is not known here."""
    for display in displays(root):
        size = f"{display.width}x{display.height}"
        named = f"{display.name} ({size})"
        if not display.width_mm:
            report.find("screen_unknown", named)
            continue
        _check_size(report, panel, display, named)
        screen = Screen.from_size(size, panel.mm_per_px)
        for page in panel.pages:
            if page.fit and not page.template and (why := fit.reason(panel, page, screen)):
                report.find("page_too_large", page.id, screen=size, detail=why)


def _check_size(report: Report, panel: Panel, display: ConnectedScreen, named: str) -> None:
    real = KEY_MM * display.mm_per_px / panel.mm_per_px
    details = {
        "screen": f"{display.mm_per_px:.3g}",
        "panel": f"{panel.mm_per_px:g}",
        "real_mm": f"{real:.0f}",
    }
    if real < KEY_MM * (1 - TOLERANCE):
        report.find("screen_small_targets", named, **details)
    elif real > KEY_MM * (1 + TOLERANCE):
        report.find("screen_scale", named, **details)
    else:
        report.fact(
            f"the screen {named} is {display.width_mm} x {display.height_mm} mm, as the panel says"
        )


# Which of a panel's languages this machine has fonts for, by fontconfig, which browsers ask too.
#
# Without a browser it needs none: the panel is shown elsewhere, or `operator-panel install` brings
# both.

QUERY_TIMEOUT_S: Final = 20.0  # fontconfig may have to read every font first
FOLDERS: Final = (
    Path("/usr/share/fonts"),
    Path("/usr/local/share/fonts"),
    Path("~/.fonts"),
    Path("~/.local/share/fonts"),
)
PACKAGES: Final[Mapping[str, str]] = {
    "ja": "fonts-noto-cjk",
    "zh": "fonts-noto-cjk",
    "ko": "fonts-noto-cjk",
}
LATIN: Final = "fonts-dejavu-core"
BROWSERS: Final = ("chromium", "google-chrome", "google-chrome-stable", "firefox", "firefox-esr")
CJK_NAMES: Final = ("cjk", "ipag", "ipaex", "takao", "vlgothic", "wqy", "nanum", "sourcehan")

HasFont = Callable[[str], bool]
HasBrowser = Callable[[], bool]


def has_browser() -> bool:
    return any(map(shutil.which, BROWSERS))


def has_font(language: str) -> bool:
    """Whether a font has the letters of a language ("ja")."""
    program = shutil.which("fc-list")
    if program is not None:
        listed = subprocess.run(
            [program, f":lang={language}", "file"],
            capture_output=True,
            text=True,
            timeout=QUERY_TIMEOUT_S,
        )
        return bool(listed.stdout.strip())
    names = [file.name.lower() for folder in FOLDERS for file in _font_files(folder.expanduser())]
    if language in PACKAGES:
        return any(known in name for known in CJK_NAMES for name in names)
    return bool(names)


def _font_files(folder: Path) -> list[Path]:
    return [file for file in folder.rglob("*") if file.suffix.lower() in (".ttf", ".otf", ".ttc")]


def check_fonts(
    report: Report,
    languages: tuple[str, ...],
    has: HasFont = has_font,
    browser: HasBrowser = has_browser,
) -> None:
    if not browser():
        report.fact("no browser is installed here: no fonts are needed")
        return
    missing = [tag for tag in languages if not has(tag.partition("-")[0])]
    for tag in missing:
        package = PACKAGES.get(tag.partition("-")[0], LATIN)
        report.find("fonts_missing", tag, package=package)
    if not missing:
        report.fact(f"there are fonts for {', '.join(languages)}")

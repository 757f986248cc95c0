"""The sizes of this machine's screens, from their EDID, against what the panel file says of them.

Source: VESA Enhanced EDID Standard 1.4: bytes 21 and 22 are the size in cm, the first detailed timing
descriptor (from byte 54) has pixels and mm.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from app.diagnose.findings import Report
from app.panel.checks import fit
from app.panel.model import Panel
from app.panel.widgets.tiles import KEY_MM, Screen

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

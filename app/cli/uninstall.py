"""`operator-panel uninstall`: see `app.cli.install`."""

from app.cli.install import _uninstall_parser as _parser
from app.cli.install import uninstall as main

__all__ = ["_parser", "main"]

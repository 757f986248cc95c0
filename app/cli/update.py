"""`operator-panel update`: see `app.cli.install`."""

from app.cli.install import _update_parser as _parser
from app.cli.install import update as main

__all__ = ["_parser", "main"]

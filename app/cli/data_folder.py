"""The data folder of a panel that a command works on: by `--data`, `--panel`, else by the settings."""

import os
from pathlib import Path
from typing import Any

from app.cli.arguments import environment
from app.cli.parser import Parser
from app.settings import Settings


def add_data_folder(parser: Parser) -> None:
    """--data, --panel."""
    parser.add_argument("--data", metavar="FOLDER", help="the data folder (KIOSK_DATA)")
    parser.add_argument("--panel", metavar="PANEL", help="the panel whose data folder it is")


def data_folder(options: Any) -> Path:
    """That of a server that was started with these options and settings. The panel file is read only if
    it decides which: one with a fault, a KioskError, does not matter else."""
    settings = Settings.from_environment({**os.environ, **environment(options)})
    if settings.data is not None:
        return settings.data
    from app.panel import load_panel  # takes half of a command's time, and is seldom needed

    return settings.data_folder(settings.mode or load_panel(settings.panel).mode)

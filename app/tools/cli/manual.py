"""`operator-panel manual [PANEL]`: the printable manual of a panel, one HTML file.

Exit status: 0 written, 1 it can't be written, 2 a mistake on the command line, in the settings or in
the panel file.
"""

import hashlib
import os
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from app.panel import load_panel
from app.panel.model import Panel
from app.ros.messages import load_interfaces
from app.system.clock import format_datetime
from app.system.errors import KioskError, SettingsError
from app.system.settings import Settings, shipped_path
from app.tools.cli.arguments import PANEL_HELP, environment
from app.tools.cli.output import OutputError, add_force, check_absent, draft_of
from app.tools.cli.parser import Parser
from app.web.pages.compiled_templates import COMPILED
from app.web.pages.manual import TEMPLATE, manual_context
from app.web.pages.page_templates import PageTemplates

PROG: Final = "python -m app.cli manual"


def main(arguments: Sequence[str], prog: str = PROG) -> int:
    options = make_parser(prog).parse_args(arguments)
    try:
        settings = Settings.from_environment({**os.environ, **environment(options)})
        panel = load_panel(settings.panel)
        language = options.language or panel.language
        if language not in panel.readers_languages:
            known = ", ".join(panel.readers_languages)
            raise SettingsError(f'{settings.panel} is not in the language "{language}": it has {known}')
        text = _text(panel, settings.panel, language)
        file = options.output or Path(f"{settings.panel.stem}-manual-{language}.html")
        check_absent(file, options.force)
        with draft_of(file, options.force) as draft:
            draft.write_text(text, encoding="utf-8")
    except OutputError as error:
        print(error, file=sys.stderr)
        return 1
    except KioskError as error:
        print(error, file=sys.stderr)
        return 2
    print(f"{file}: {len(panel.commands)} controls, {len(panel.alarms)} alarms")
    return 0


def _text(panel: Panel, file: Path, language: str) -> str:
    templates = PageTemplates(shipped_path("templates"), compiled=shipped_path(COMPILED))
    digest = hashlib.sha256(file.read_bytes()).hexdigest()
    interfaces = load_interfaces(panel.distro, panel.interfaces)
    context = manual_context(panel, interfaces, file, digest, format_datetime(time.time()), language)
    return templates.render(TEMPLATE, language, **context)


def make_parser(prog: str) -> Parser:
    parser = Parser(
        prog=prog,
        description="Writes the manual of a panel as one HTML file to read and to print: its controls,"
        " interlocks, conditions, recipes, states and alarms, with the SHA-256 of the panel file.",
        epilog="Exit status: 0 written, 1 it can't be written, 2 a mistake on the command line, in the"
        " settings or in the panel file.",
    )
    parser.add_argument("panel", nargs="?", metavar="PANEL", help=PANEL_HELP)
    parser.add_argument("--language", metavar="TAG", help="such as de; default: that of the panel file")
    parser.add_argument(
        "-o", "--output", type=Path, metavar="FILE", help="default: PANEL-manual-LANGUAGE.html"
    )
    add_force(parser)
    return parser

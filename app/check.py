"""`python -m app.check [PANEL]`: every fault of a panel file, with its place.

Exit status: 0 the panel is good, 1 it has faults, 2 it can't be read.
"""

import sys
from pathlib import Path

from app.errors import KioskError, PanelError
from app.panel import load_panel
from app.settings import Settings


def main(arguments: list[str]) -> int:
    if len(arguments) > 1:
        print("usage: python -m app.check [PANEL]", file=sys.stderr)
        return 2
    try:
        path = Path(arguments[0]) if arguments else Settings.from_environment().panel
        panel = load_panel(path)
    except PanelError as error:
        print(error, file=sys.stderr)
        return 2 if error.unreadable else 1
    except KioskError as error:
        print(error, file=sys.stderr)
        return 2
    count = sum(1 for _ in panel.widgets())
    robots = f"{len(panel.robots)} robot(s), " if panel.robots else ""
    print(f'{path}: good: "{panel.title}", {robots}{len(panel.pages)} page(s), {count} widget(s)')
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

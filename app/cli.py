"""`python -m app.cli`: `operator-panel` where it is not installed."""

import sys

from app.tools.cli.command import main

if __name__ == "__main__":
    sys.exit(main())

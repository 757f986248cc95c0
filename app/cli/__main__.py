"""`python -m app.cli`: `operator-panel` where it is not installed."""

import sys

from app.cli.command import main

if __name__ == "__main__":
    sys.exit(main())

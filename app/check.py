"""`python -m app.check`: the same as `operator-panel check`."""

import sys

from app.tools.cli.check import main
from app.tools.cli.parser import until_closed

if __name__ == "__main__":
    sys.exit(until_closed(lambda: main(sys.argv[1:])))

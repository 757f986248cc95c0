"""`python -m app.check`: the same as `operator-panel check`."""

import sys

from app.cli.check import main
from app.cli.pipe import until_closed

if __name__ == "__main__":
    sys.exit(until_closed(lambda: main(sys.argv[1:])))

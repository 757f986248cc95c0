"""`python -m app.log`: the same as `operator-panel log`."""

import sys

from app.cli.log import main
from app.cli.pipe import until_closed

if __name__ == "__main__":
    sys.exit(until_closed(lambda: main(sys.argv[1:])))

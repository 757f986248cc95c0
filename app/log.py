"""`python -m app.log`: the same as `operator-panel log`."""

import sys

from app.tools.cli.log import main
from app.tools.cli.parser import until_closed

if __name__ == "__main__":
    sys.exit(until_closed(lambda: main(sys.argv[1:])))

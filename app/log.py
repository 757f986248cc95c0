"""`python -m app.log`: the same as `operator-panel log`."""

import sys

from app.cli.log import main

if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

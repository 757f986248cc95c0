"""`python -m app.check`: the same as `operator-panel check`."""

import sys

from app.cli.check import main

if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

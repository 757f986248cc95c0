"""`python -m app.simulator`: the same as `operator-panel simulate`."""

import sys

from app.tools.cli.simulate import main

if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

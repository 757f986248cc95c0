"""`python -m app.simulator`: the demo robot alone."""

import sys

from app.simulator.zenoh_peer import main

if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

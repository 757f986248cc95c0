"""`python -m app.log`: the command of `app.audit`, under the name that users know."""

import sys

from app.audit.__main__ import main

if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

"""`python -m app.kiosk.waiting_page PANEL FILE`: the page shown until the panel server answers."""

import sys

from app.tools.kiosk.waiting_page import main

if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))

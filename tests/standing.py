"""The application with a link that never closes, for `uvicorn tests.standing:app`."""

import time

from app import main
from app.link import Link

vars(main)["ENDED_WITHIN_S"] = 1.0


def never(self: Link) -> None:
    time.sleep(60)


Link.close = never  # type: ignore[method-assign]
app = main.app

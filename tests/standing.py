"""The application with a link that never closes, for `uvicorn tests.standing:app`."""

import time

from app import ending, kiosk, main
from app.link import Link


class Standing(Link):
    def close(self) -> None:
        time.sleep(60)


vars(kiosk)["Link"] = Standing
vars(ending)["ENDED_WITHIN_S"] = 1.0
app = main.app

"""The application with a link that never closes, for `uvicorn tests.support.apps.standing:app`."""

import time

from app import main
from app.process import shutdown
from app.runtime import wiring
from app.transport.zenoh_session import ZenohSession


class Standing(ZenohSession):
    def close(self) -> None:
        time.sleep(60)


vars(wiring)["ZenohSession"] = Standing
vars(shutdown)["SHUTDOWN_TIMEOUT_S"] = 5.0
app = main.app

"""The application with a link that never closes, for `uvicorn tests.support.apps.standing:app`."""

import time

from app import main
from app.cell.session import session
from app.ros.zenoh.session import ZenohSession
from app.system.process import shutdown


class Standing(ZenohSession):
    def close(self) -> None:
        time.sleep(60)


vars(session)["ZenohSession"] = Standing
vars(shutdown)["SHUTDOWN_TIMEOUT_S"] = 5.0
app = main.app

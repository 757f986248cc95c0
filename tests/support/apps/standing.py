"""The application with a link that never closes, for `uvicorn tests.support.apps.standing:app`."""

import time
from unittest import mock

from app import main
from app.ros.zenoh.session import ZenohSession
from app.system.process import shutdown


def stand(_: ZenohSession) -> None:
    time.sleep(60)


mock.patch.object(ZenohSession, "close", stand).start()
vars(shutdown)["SHUTDOWN_TIMEOUT_S"] = 5.0
app = main.app

"""The application with little time and few places, for `uvicorn tests.hasty:app`."""

from app import connections, main
from app.routes import messages
from tests.small import CONNECTIONS

vars(connections).update(HEAD_WITHIN_S=0.5, CONNECTIONS_MOST=CONNECTIONS)
vars(messages)["BODY_WITHIN_S"] = 0.5
app = main.app

"""The application with little time and few places, for `uvicorn tests.hasty:app`."""

from app import connections, main
from app.routes import messages

MOST = 20

vars(connections).update(HEAD_WITHIN_S=0.5, CONNECTIONS_MOST=MOST)
vars(messages)["BODY_WITHIN_S"] = 0.5
app = main.app

"""The application with a short timeout of bodies and few connections, for `uvicorn
tests.support.apps.hasty:app`."""

from app import main
from app.web import connections, request_body
from tests.support.apps.small import CONNECTIONS

vars(connections)["CONNECTIONS_MOST"] = CONNECTIONS
vars(request_body)["BODY_WITHIN_S"] = 0.5
app = main.app

"""The application with short timeouts of bodies, repeated log lines and a broker, and few connections,
for `uvicorn tests.support.apps.hasty:app`."""

from app import main, repeated_records
from app.alarms import own
from app.web import connections, request_body, server_log
from tests.support.apps.small import CONNECTIONS

vars(connections)["CONNECTIONS_MOST"] = CONNECTIONS
vars(repeated_records)["COUNTED_FOR_S"] = 2.0
vars(server_log)["COUNT_EVERY_S"] = 0.2
vars(own)["BROKER_WITHIN_S"] = 1.0
vars(request_body)["BODY_WITHIN_S"] = 0.5
app = main.app

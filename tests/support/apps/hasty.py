"""The application with short timeouts of bodies, repeated log lines, a broker and a
central database, and few connections,
for `uvicorn tests.support.apps.hasty:app`."""

from app import main
from app.cell.alarms import sources
from app.system import log
from app.web import requests, server
from tests.support.apps.small import CONNECTIONS

vars(server)["CONNECTIONS_MOST"] = CONNECTIONS
vars(log)["COUNTED_FOR_S"] = 2.0
vars(server)["COUNT_EVERY_S"] = 0.2
vars(sources)["BROKER_WITHIN_S"] = 1.0
vars(sources)["FORWARDS_WITHIN_S"] = 1.0
vars(requests)["BODY_WITHIN_S"] = 0.5
app = main.app

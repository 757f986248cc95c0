"""The application with a demo robot that always permits operation, for `uvicorn
tests.support.apps.permitted:app`."""

from app import main
from app.simulator import robot

vars(robot)["PERMITTED_S"] = 1e9
app = main.app

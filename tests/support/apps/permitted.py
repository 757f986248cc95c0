"""The application with a demo robot that always permits operation, and leases of holds that are four
times as long, for `uvicorn tests.support.apps.permitted:app`."""

from app import main
from app.commands.holds import controller, lease
from app.simulator import robot

for module in (controller, lease):
    vars(module)["LEASE_S"] = 1.0
vars(robot)["PERMITTED_S"] = 1e9
app = main.app

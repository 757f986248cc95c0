"""The application with a demo robot that always permits operation, and leases of holds that are four
times as long, for `uvicorn tests.support.apps.permitted:app`."""

from app import main
from app.cell.commands import holds
from app.tools.simulator import robot

for module in (holds, holds):
    vars(module)["LEASE_S"] = 1.0
vars(robot)["PERMITTED_S"] = 1e9
app = main.app

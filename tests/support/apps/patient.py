"""The application with long timeouts, for busy machines, for `uvicorn tests.support.apps.patient:app`.

Its demo robot always permits operation, a hold continues long without a heartbeat, and control stays
long without a keepalive.
"""

from app import main
from app.cell.commands import control_acts, holds
from app.cell.permission import control
from app.tools.simulator import robot
from app.web.routes import holds as hold_socket

LEASE_S = 20.0

vars(holds)["LEASE_S"] = LEASE_S
for module in (control, control_acts):
    vars(module)["LIFE_S"] = 2 * LEASE_S
vars(hold_socket).update(BEGIN_WITHIN_S=2 * LEASE_S, SILENCE_S=2 * LEASE_S)
vars(robot)["PERMITTED_S"] = 1e9
app = main.app

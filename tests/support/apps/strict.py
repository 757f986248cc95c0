"""The application of `tests.support.apps.patient` with low rate limits, for `uvicorn
tests.support.apps.strict:app`."""

from app.cell.commands import judge
from app.system.limits import Quota
from tests.support.apps import patient
from tests.support.apps.small import PRESSES

vars(judge).update(CLIENT_QUOTA=Quota(PRESSES, 1), CANCEL_QUOTA=Quota(PRESSES, 1))
app = patient.app

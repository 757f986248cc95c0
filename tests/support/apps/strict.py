"""The application of `tests.support.apps.patient` with low rate limits, for `uvicorn
tests.support.apps.strict:app`."""

from app.commands import press_limits
from app.rate_limit import Quota
from tests.support.apps import patient
from tests.support.apps.small import PRESSES

vars(press_limits).update(CLIENT_QUOTA=Quota(PRESSES, 1), CANCEL_QUOTA=Quota(PRESSES, 1))
app = patient.app

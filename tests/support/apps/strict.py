"""The application with small limits of presses, for `uvicorn tests.support.apps.strict:app`."""

from app import main
from app.commands import press_limits
from app.rate_limit import Quota
from tests.support.apps.small import PRESSES

vars(press_limits).update(OF_CLIENT=Quota(PRESSES, 1), OF_CANCELS=Quota(PRESSES, 1))
app = main.app

"""The application with small limits of presses, for `uvicorn tests.strict:app`."""

from app import main, press_limits
from app.rate_limit import Quota
from tests.small import PRESSES

vars(press_limits).update(OF_CLIENT=Quota(PRESSES, 1), OF_CANCELS=Quota(PRESSES, 1))
app = main.app

"""The application with small limits of presses, for `uvicorn tests.strict:app`."""

from app import main, press_limits
from app.rate_limit import Quota

AT_ONCE = 10

vars(press_limits).update(OF_CLIENT=Quota(AT_ONCE, 1), OF_CANCELS=Quota(AT_ONCE, 1))
app = main.app

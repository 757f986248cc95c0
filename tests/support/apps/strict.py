"""The application of `tests.support.apps.patient` with low rate limits, for `uvicorn
tests.support.apps.strict:app`: those of presses and cancels, or the one that `STRICT_LIMIT` names."""

import os
from dataclasses import replace
from typing import Any, cast

from app.cell.permission.client_limits import RATE_LIMITS
from app.system.limits import Quota
from tests.support.apps import patient
from tests.support.apps.small import PRESSES

named = os.environ.get("STRICT_LIMIT")
for name in (named,) if named else ("presses", "cancels"):
    limit = replace(RATE_LIMITS[name], quota=Quota(PRESSES, 0.1 if named else 1))
    cast(dict[str, Any], RATE_LIMITS)[name] = limit
app = patient.app

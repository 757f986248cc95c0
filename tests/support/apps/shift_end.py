"""The server's application a short time before the reasons of a shift are asked together."""

import time
from typing import Final

from app.cell.alarms.report import shift_at
from app.cell.session import state_recorder, stops
from app.main import app

AFTER_S: Final = 18.0  # its start
STARTS: Final = ("06:00", "14:00", "22:00")
now = time.time()
left_s = shift_at(now, STARTS).until - now - AFTER_S
for module in (state_recorder, stops):
    vars(module)["ASK_BEFORE_END_S"] = left_s  # Final in the application
__all__ = ["app"]

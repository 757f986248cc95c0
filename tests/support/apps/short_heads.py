"""The application with a short timeout of request heads, the seconds in HEAD_WITHIN_S, for `uvicorn
tests.support.apps.short_heads:app`."""

import os

from app import main
from app.web import server

vars(server)["HEAD_WITHIN_S"] = float(os.environ["HEAD_WITHIN_S"])
app = main.app

"""The application with a short refresh interval of pages without scripts, for
`uvicorn tests.support.apps.reloading:app`."""

from app import main
from app.web.routes import pages

vars(pages)["REFRESH_WITH_INPUTS_S"] = 3
app = main.app

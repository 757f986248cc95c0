"""The application whose pages without scripts soon load themselves again, for
`uvicorn tests.support.apps.reloading:app`."""

from app import main
from app.web.routes import pages

vars(pages)["REFRESH_WITH_INPUTS_S"] = 3
app = main.app

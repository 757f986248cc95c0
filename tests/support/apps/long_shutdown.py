"""The application that waits long for responses at shutdown, for
`uvicorn tests.support.apps.long_shutdown:app`."""

from app import main

vars(main)["RESPONSE_TIMEOUT_S"] = 10.0
app = main.app

"""The application with long timeouts, also for responses at shutdown, for
`uvicorn tests.support.apps.long_stop:app`."""

from tests.support.apps import long_shutdown, patient

assert long_shutdown.app is patient.app
app = patient.app

"""The application that trusts the release keys in the file `TEST_RELEASE_KEYS`, and looks at its
machine at once and often, for `uvicorn tests.support.apps.pinned:app`."""

import os

from app import main
from app.cell.session import assembly, machine_watch
from app.system import minisign

vars(minisign)["PINNED"] = os.environ["TEST_RELEASE_KEYS"]
vars(machine_watch)["LOOK_EVERY_S"] = 0.2
vars(machine_watch)["READ_EVERY"] = 1
vars(assembly)["MACHINE_AFTER_S"] = 0.1
app = main.app

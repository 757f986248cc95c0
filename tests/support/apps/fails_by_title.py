"""The application, which does not come up with some panels: by the title of the panel file it ends
while it is imported, fails in its startup, or ends there."""

import os
import tomllib
from pathlib import Path
from typing import Any

import app.main as wired
from app.main import app as app

TITLE = tomllib.loads(Path(os.environ["KIOSK_PANEL"]).read_text())["title"]

if TITLE == "ends at import":
    os._exit(70)
if TITLE in ("fails at start", "ends at start"):

    def fails(*_: Any) -> None:
        if TITLE == "ends at start":
            os._exit(71)
        raise RuntimeError("this panel does not start")

    vars(wired)["open_state"] = fails

"""The script in each page that runs before its modules: it has no file that could be missing."""

import base64
import hashlib
from typing import Final

from markupsafe import Markup

from app.settings import shipped_path
from app.web.assets import asset


def _script() -> str:
    """The script of `static/js/guard.js` as it is sent."""
    return asset((shipped_path("static") / "js/guard.js").read_bytes(), ".js").content.decode()


def script_hash(script: str) -> str:
    """The source of a Content-Security-Policy that permits this inline script alone."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()}'"


PAGE_GUARD: Final = Markup(_script())
PAGE_GUARD_HASH: Final = script_hash(PAGE_GUARD)

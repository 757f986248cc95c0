"""The application, whose user may not write the panel file: root may write each."""

import os
from typing import Any

from app.main import app as app

_access = os.access


def access(path: Any, mode: int, **more: Any) -> bool:
    return mode != os.W_OK and _access(path, mode, **more)


os.access = access

"""The language of a panel file, as the browser requests it at first."""

import re
import tomllib
from pathlib import Path
from typing import Final

TAG: Final = re.compile(r"[A-Za-z]{2,3}(-[A-Za-z0-9]{2,8})*")


def panel_language(panel: Path) -> str:
    """`language` of the file, "en" where it does not say; "" if it can't be read: the server
    reports what is wrong with it."""
    try:
        language = tomllib.loads(panel.read_text()).get("language", "en")
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError):
        return ""
    return language if isinstance(language, str) and TAG.fullmatch(language) else ""

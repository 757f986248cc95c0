"""Values as TOML writes them, on one line. Source: TOML 1.0.0 (toml.io)."""

import json
import re
from collections.abc import Mapping
from typing import Any, Final

_PLAIN_KEY: Final = re.compile(r"[A-Za-z0-9_-]+")


def key_text(name: str) -> str:
    """A key, in quotes where it needs them."""
    return name if _PLAIN_KEY.fullmatch(name) else value_text(name)


def value_text(value: Any) -> str:
    """A bool, a number, a text, or a list or table of them."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, str):
        whole = value.encode(errors="replace").decode()  # TOML has no lone surrogates
        return json.dumps(whole, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, Mapping):
        inner = ", ".join(f"{key_text(key)} = {value_text(item)}" for key, item in value.items())
        return f"{{ {inner} }}" if inner else "{}"
    return f"[{', '.join(map(value_text, value))}]"

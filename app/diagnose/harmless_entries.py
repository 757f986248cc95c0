"""Entries of the operator's log for a support bundle: by known columns, a reason by its codes and the
parameters that are known to be harmless. What was typed in is in neither."""

import json
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from typing import Any

from app.audit.queries import Row
from app.diagnose.harmless import DEEPEST, ID, LEFT_OUT, harmless, harmless_value
from app.diagnose.harmless_keys import LOG, SENTENCE


def harmless_entry(row: Row) -> dict[str, Any]:
    entry = row.entry._asdict() | {"at": _time(row.entry.at), "pressed_at": _time(row.pressed_at)}
    known = harmless_value(entry, LOG).items()
    shown = {name: value for name, value in known if value not in ("", None)}
    try:
        texts = list(_texts(json.loads(row.entry.text or "{}")))
    except (ValueError, RecursionError):
        texts = []
    parameters: dict[str, Any] = {}
    for text in texts:
        parameters |= harmless_value(text["params"], SENTENCE)
    codes = [harmless(text["code"], ID) for text in texts]
    told = {name: value for name, value in parameters.items() if value != LEFT_OUT}
    return shown | {"codes": codes, "parameters": told}


def _texts(value: Any, depth: int = 0) -> Iterator[Mapping[str, Any]]:
    """A sentence and those in its parameters; values such as "=time" are none."""
    if depth > DEEPEST or not isinstance(value, Mapping):
        return
    code, inner = value.get("code"), value.get("params")
    if not isinstance(code, str) or not isinstance(inner, Mapping):
        return
    if not code.startswith("="):
        yield {"code": code, "params": {k: v for k, v in inner.items() if not isinstance(v, Mapping)}}
    for text in inner.values():
        yield from _texts(text, depth + 1)


def _time(ms: int | None) -> str | None:
    if ms is None:
        return None
    return datetime.fromtimestamp(ms / 1000, UTC).isoformat(timespec="milliseconds")

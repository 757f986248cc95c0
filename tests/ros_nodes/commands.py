"""Commands as JSON lines: `{"do": name, …}` in, `{"ok": …}` or `{"error": …}` out, until stdin ends.

Who asks is `tests/support/processes/commanded.py`. This side runs in environments that have nothing of
the kiosk.
"""

import json
import sys
from typing import Any


def obey(commands: object, first: Any = "ready") -> None:
    """Says `first`, then calls the method of `commands` that each line names, with what else it has."""
    _say({"ok": first})
    for line in sys.stdin:
        request = json.loads(line)
        try:
            answer = {"ok": getattr(commands, request.pop("do"))(**request)}
        except Exception as error:  # whatever went wrong is the answer
            answer = {"error": f"{type(error).__name__}: {error}"}
        _say(answer)


def _say(answer: dict[str, Any]) -> None:
    print(json.dumps(answer), flush=True)

"""What a running server says of itself, for a support bundle: states, codes, counts and times, without
the texts and values that its pages show."""

import json
import re
from collections.abc import Mapping
from typing import Any, Final

from app.diagnose.harmless import ID, Rule, Rules, harmless, harmless_value
from app.diagnose.harmless_keys import LINK, SNAPSHOT, WIDGET

DATA: Final = "data: "
# A sample of Prometheus's text format, or the type of one.
_METRIC: Final = re.compile(
    r"# TYPE \w{1,80} \w{1,20}|"
    r'\w{1,80}(?:\{(?:\w{1,40}="[\w/.\-]{0,100}",?){0,9}\})? [\d.eE+\-]{1,30}',
    re.ASCII,
)


def harmless_snapshot(events: str) -> Any:
    """Of the first event of `/events`, which has everything that the pages show; None if it has not."""
    line = next((line for line in events.split("\n") if line.startswith(DATA)), "")
    try:
        snapshot = json.loads(line.removeprefix(DATA))
    except (ValueError, RecursionError):
        return None
    if not isinstance(snapshot, Mapping):
        return None
    return {
        **harmless_value(snapshot, SNAPSHOT),
        **{name: by_id(snapshot.get(name), WIDGET) for name in ("interlocks", "widgets")},
        "link": by_id(snapshot.get("link"), LINK),
        "state": harmless_value(snapshot.get("state"), WIDGET),
    }


def by_id(value: Any, keys: Rules, rule: Rule = None) -> dict[str, Any]:
    """Of a table by ids, such as those of widgets."""
    table = value if isinstance(value, Mapping) else {}
    return {key: harmless_value(row, keys, rule) for key, row in table.items() if ID.fullmatch(key)}


def harmless_ready(answer: Any) -> Any:
    """Of the response of `/readyz`."""
    if not isinstance(answer, Mapping):
        return None
    codes = {key: harmless(str(answer[key]), ID) for key in ("code",) if key in answer}
    robots = by_id(answer.get("robots"), {}, ID)
    return {"ready": answer.get("status") == "ready", **codes, "robots": robots}


def harmless_metrics(text: str) -> str:
    return "".join(f"{line}\n" for line in text.split("\n") if _METRIC.fullmatch(line))

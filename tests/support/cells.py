"""Summaries of cells as panels publish them, and sessions that publish some at a router."""

import json
import threading
from typing import Any, Final

import zenoh

from app.ros.zenoh.config import config_to
from app.ros.zenoh.site import alive_key, summary_key

STATES: Final = {
    "running": ("RUNNING", "play", "grey"),
    "waiting": ("WAITING", "diamond", "grey"),
    "manual": ("MANUAL", "circle", "grey"),
    "fault": ("FAULT", "cross", "red"),
    "unknown": ("waiting for data", "waiting", "none"),
}
AGAIN_S: Final = 3.0
SINCE: Final = "2026-11-25T14:40:00.000+00:00"


def alarm(priority: int, text: Any, **changes: Any) -> dict[str, Any]:
    own = {"id": f"a{priority}", "state": "active", "acknowledged": False, "since": SINCE}
    return {**own, "priority": priority, "text": text, **changes}


def summary(site: str, cell: str, kind: str = "running", **changes: Any) -> dict[str, Any]:
    """What a panel of version 0 publishes, with some values of another kind."""
    word, shape, colour = STATES[kind]
    alarms = changes.get("alarm_list", [])
    counts = {str(p): sum(each["priority"] == p for each in alarms) for p in (1, 2, 3, 4)}
    figure = {"id": "rate", "label": "Rate", "text": "305 boxes/h", "unit": "boxes/h", "state": "live"}
    return {
        "site": site,
        "cell": cell,
        "url": f"https://{cell.replace(' ', '-')}.plant.example/",
        "state": {"kind": kind, "text": word, "shape": shape, "colour": colour},
        "since": SINCE,
        "alarms": counts,
        "unacknowledged": counts,
        "alarm_list": [],
        "figures": [figure],
        "control": {"required": False, "holder": ""},
        "version": "0.3.0",
        "links": [{"robot": "Robot 1", "state": "ok"}],
        "simulated": False,
        "twin": "",
        "instance": f"i-{cell.replace(' ', '-')}",
        "at": SINCE,
        **changes,
    }


def payload(site: str, cell: str, kind: str = "running", **changes: Any) -> bytes:
    return json.dumps(summary(site, cell, kind, **changes)).encode()


def client_of(endpoint: str) -> zenoh.Session:
    """A client of a router that is there; with its stamp, as panels have it."""
    config = config_to(endpoint)
    config.insert_json5("mode", '"client"')
    config.insert_json5("timestamping/enabled", "true")
    return zenoh.open(config)


class Cells:
    """Cells without panels, by one session. Each has its token, answers queries and says the same again
    every few seconds, as panels do."""

    def __init__(self, endpoint: str) -> None:
        self.session = client_of(endpoint)
        self.latest: dict[tuple[str, str], bytes] = {}
        self._tokens: dict[tuple[str, str], zenoh.LivelinessToken] = {}
        self._answering = self.session.declare_queryable(summary_key(), self._answer)
        self._closed = threading.Event()
        self._saying = threading.Thread(target=self._say_again, daemon=True)
        self._saying.start()

    def _answer(self, query: zenoh.Query) -> None:
        with query:
            for names, content in [*self.latest.items()]:
                if zenoh.KeyExpr(summary_key(*names)).intersects(query.key_expr):
                    query.reply(summary_key(*names), content)

    def put(self, site: str, cell: str, kind: str = "running", **changes: Any) -> None:
        self.put_bytes(site, cell, payload(site, cell, kind, **changes))

    def put_bytes(self, site: str, cell: str, content: bytes) -> None:
        names = (site, cell)
        self.latest[names] = content
        if names not in self._tokens:
            self._tokens[names] = self.session.liveliness().declare_token(alive_key(*names))
        self.session.put(summary_key(*names), content)

    def _say_again(self) -> None:
        while not self._closed.wait(AGAIN_S):
            for names, content in [*self.latest.items()]:
                self.session.put(summary_key(*names), content)

    def withdraw(self, site: str, cell: str) -> None:
        self.latest.pop((site, cell))
        self._tokens.pop((site, cell)).undeclare()

    def close(self) -> None:
        self._closed.set()
        self._saying.join()
        self.session.close()

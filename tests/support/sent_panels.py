"""A server that takes panel files, and what is sent to it."""

import io
import zipfile
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Final

import httpx

from tests.support.parts import ROOT, Server, http_client, until
from tests.support.users import log_rows, token_of

PANEL: Final = """\
title = "Cell 1"
mode = "demo"
[[page]]
id = "main"
title = "Main"
[[page.widget]]
id = "start"
kind = "publish"
label = "Start"  # the first one
topic = "/start"
type = "std_msgs/msg/Bool"
message = { data = true }
"""
OTHER: Final = PANEL.replace('"Start"', '"Go"')
ZIP: Final = {"content-type": "application/zip"}


NO_FILES: Final[Mapping[str, bytes]] = {}


def packed(text: str, files: Mapping[str, bytes] = NO_FILES) -> bytes:
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w") as archive:
        archive.writestr("panel.toml", text)
        for name, content in files.items():
            archive.writestr(name, content)
    return data.getvalue()


class Kiosk:
    """A server of its own process, which takes panel files, with clients by their roles."""

    def __init__(self, folder: Path, text: str = PANEL, **environment: str) -> None:
        self.panel = folder / "cell" / "panel.toml"
        self.panel.parent.mkdir(exist_ok=True)
        self.panel.write_text(text)
        self.tokens = {
            role: token_of(folder / "data", role, role) for role in ("engineer", "maintenance")
        }
        self.environment = {
            "KIOSK_PANEL": str(self.panel),
            "KIOSK_DATA": str(folder / "data"),
            "KIOSK_TAKE_PANEL": "1",
            "PYTHONUNBUFFERED": "1",  # a process that is not forked can start again
            **environment,
        }
        self._clients = ExitStack()
        self.start()

    def start(self, port: int = 0, app: str = "app.main:app") -> None:
        self.server = Server(ROOT, port, app=app, **self.environment)
        self.url = self.server.url
        self.engineer = self.client(self.tokens["engineer"])

    def client(self, token: str) -> httpx.Client:
        headers = {"authorization": f"Bearer {token}"} if token else {}
        return self._clients.enter_context(http_client(self.url, headers=headers))

    def check(self, text: str, files: Mapping[str, bytes] = NO_FILES) -> httpx.Response:
        return self.engineer.post("/panel/check", content=packed(text, files), headers=ZIP)

    def take(self, checked: Mapping[str, Any], **more: str) -> httpx.Response:
        body = {"sent": checked["sent"], "compared": checked["compared"], **more}
        return self.engineer.post("/panel/take", json=body)

    def state(self) -> dict[str, Any]:
        try:
            known: dict[str, Any] = self.engineer.get("/panel").json()
        except httpx.TransportError:
            return {}
        return known

    def ended(self, phase: str) -> dict[str, Any]:
        last: Any = until(
            lambda: (
                (state := self.state()) and state["last"] and state["last"]["phase"] == phase and state
            ),
            f"what was sent is {phase}",
        )
        return dict(last)

    def close(self) -> None:
        self._clients.close()
        self.server.end()

    @property
    def log(self) -> list[tuple[str, str, str]]:
        """Action, outcome and user of the entries about panel files."""
        rows = log_rows(self.engineer)
        actions = [row for row in rows if row["action"].startswith("panel_")]
        return [(row["action"], row["outcome"], row["who"]) for row in actions]

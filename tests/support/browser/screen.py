"""A kiosk's screen in tests: `operator-panel kiosk` with the real Chromium, without windows."""

import json
import signal
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import httpx
from websockets.exceptions import WebSocketException
from websockets.sync.client import connect

from app.tools.kiosk.browser import LOOK
from tests.support.parts import CHROMIUM, ROOT, Process, free_port, http_client, until
from tests.support.processes.signals import send_signal

WITHOUT_GPU = ("--no-sandbox", "--disable-gpu")
HEADLESS_FLAGS = ("--headless=new", *WITHOUT_GPU)
ANSWER_WITHIN_S = 2.0
ALIVE_WITHIN_S = 2.0

PRESS = """(text) => {
    document.querySelector('[data-widget="message"] input').value = text;
    document.querySelector('[data-widget="operation"] button').click();
}"""
# Presses ten times a second, each time with another text, until the page is gone.
PRESS_ON = f"""(name) => {{
    if (window.pressed === name) return true;
    window.pressed = name;
    let number = 0;
    clearInterval(window.pressing);
    window.pressing = setInterval(() => ({PRESS})(`${{name}} ${{number++}}`), 100);
    return true;
}}"""


class KioskScreen:
    """The watcher and its browser. The test has a DevTools port in addition to the watcher's pipe."""

    def __init__(
        self,
        url: str,
        folder: Path,
        *options: str,
        before: Sequence[str] = (),
        flags: Sequence[str] = HEADLESS_FLAGS,
        **env: str,
    ) -> None:
        self.url = url
        self.folder = folder
        self.port = free_port()
        flags = (*flags, f"--remote-debugging-port={self.port}")
        command = [*before, sys.executable, "-m", "app.cli", "kiosk", f"--url={url}/"]
        command += [f"--browser={CHROMIUM}", f"--folder={folder}", *options]
        command += [f"--flag={flag}" for flag in flags]
        self.process = Process(command, {"PYTHONPATH": "", **env}, cwd=ROOT)

    def pages(self) -> list[dict[str, Any]]:
        """The pages that the browser has; none while it does not answer."""
        return pages_of(self.port)

    def _devtools(self, resource: str) -> Any:
        return _devtools(self.port, resource)

    def call(self, method: str, **params: Any) -> dict[str, Any] | None:
        """The result of a command to the page; None if it does not answer."""
        return _page_call(self.port, method, params)

    def evaluate(self, expression: str) -> Any:
        """The value of an expression in the page; None if the page does not answer."""
        return evaluated(self.port, expression)

    def lives(self) -> bool:
        """Whether exactly one page is shown, is the panel's, receives events and draws."""
        if len(self.pages()) != 1:
            return False
        page = self.evaluate(LOOK)
        if not page or not page["url"].startswith(self.url) or page["age_s"] is None:
            return False
        runs = self.evaluate("'operatorPanel' in window")  # until then it is as young as its document
        return bool(runs and page["drawn"] and page["age_s"] < ALIVE_WITHIN_S)

    def press_on(self, name: str) -> None:
        """Presses ten times a second; each press has a different text."""
        until(lambda: self.evaluate(f"({PRESS_ON})({json.dumps(name)})"), "the page presses")

    def stop_presses(self) -> None:
        stop = "clearInterval(window.pressing), true"
        until(lambda: self.evaluate(stop), "the page presses no more")

    def processes(self, kind: str) -> list[int]:
        """The processes of a kind: "browser", "renderer" or "GPU"."""
        browser = self._devtools("version")["webSocketDebuggerUrl"]
        info = _called(browser, "SystemInfo.getProcessInfo", {}) or {}
        return [process["id"] for process in info["processInfo"] if process["type"] == kind]

    def send(self, kind: str, number: signal.Signals) -> None:
        for pid in self.processes(kind):
            send_signal(pid, number)

    def end(self) -> None:
        if self.process.running:
            assert self.process.end() == 0, self.process.text


def _devtools(port: int, resource: str) -> Any:
    with http_client(f"http://127.0.0.1:{port}", ANSWER_WITHIN_S) as http:
        return http.get(f"/json/{resource}").json()


def pages_of(port: int) -> list[dict[str, Any]]:
    """The pages of the browser with this DevTools port; none while it does not answer."""
    with suppress(httpx.HTTPError):
        return [devtool for devtool in _devtools(port, "list") if devtool["type"] == "page"]
    return []


def _page_call(port: int, method: str, params: Mapping[str, Any]) -> dict[str, Any] | None:
    pages = pages_of(port)
    return _called(pages[0]["webSocketDebuggerUrl"], method, params) if pages else None


def evaluated(port: int, expression: str) -> Any:
    """The value of an expression in the page of the browser with this DevTools port; None if the page
    does not answer."""
    options = {"expression": expression, "awaitPromise": True, "returnByValue": True}
    return ((_page_call(port, "Runtime.evaluate", options) or {}).get("result") or {}).get("value")


def _called(url: str, method: str, params: Mapping[str, Any]) -> dict[str, Any] | None:
    try:
        with connect(url, open_timeout=ANSWER_WITHIN_S, max_size=None) as socket:
            socket.send(json.dumps({"id": 1, "method": method, "params": params}))
            while True:
                message = json.loads(socket.recv(ANSWER_WITHIN_S))
                if message.get("id") == 1:
                    return dict(message.get("result", {}))
    except (OSError, TimeoutError, WebSocketException):
        return None

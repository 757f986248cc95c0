"""Servers with a panel of the test, which are ready when they are returned."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tests.support.parts import ROOT, Bridge, Server, live, until


def demo_server(folder: Path, panel: str, **more: Any) -> Server:
    """A server with a panel, by its text, and its simulated robot. `more` is for `Server`."""
    path = str(panel_file(folder, panel))
    return ready(Server(ROOT, KIOSK_PANEL=path, KIOSK_MODE="demo", **more))


def live_server(bridge: Bridge | str, folder: Path, panel: str, **more: Any) -> Server:
    """A server with a panel, by its text, behind a bridge or what is at an endpoint. `more` is for
    `Server`."""
    path = str(panel_file(folder, panel))
    endpoint = bridge if isinstance(bridge, str) else bridge.endpoint
    return ready(live(endpoint, folder, KIOSK_PANEL=path, **more))


def ready(server: Server) -> Server:
    """The server when it is ready; a server that does not get ready is ended."""
    try:
        until(server.ready, "ready")
    except BaseException:
        server.end()
        raise
    return server


@contextmanager
def kept_running(start: Callable[[], Server]) -> Iterator[Callable[[], Server]]:
    """Returns a running server: a new one if a test has ended the one before."""
    servers: list[Server] = []

    def running() -> Server:
        if not servers or not servers[-1].process.running:
            servers.append(start())
        return servers[-1]

    try:
        yield running
    finally:
        for server in servers:
            server.end()


def panel_file(folder: Path, panel: str) -> Path:
    """A file with this panel."""
    path = folder / "cell.toml"
    path.write_text(panel)
    return path

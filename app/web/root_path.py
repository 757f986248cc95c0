"""The path below which a proxy shows the panel, such as `/cell1`: it is in all URLs that pages have.

A proxy takes it off, or leaves it. uvicorn puts its own `--root-path` before every path in any case. So
paths come with the prefix once, twice or not at all, and go on with it once, as ASGI has it.
"""

from typing import Final

from starlette.types import ASGIApp, Receive, Scope, Send
from uvicorn import Config as ServerConfig

from app.system.errors import SettingsError
from app.system.settings import Settings, parse_root_path

# How the panel's own paths begin.
OWN_PATHS: Final = frozenset(
    {
        *("pages", "events", "widgets", "presses", "control", "robots", "log", "log.csv", "display"),
        *(
            "alarms",
            "stops",
            "oee",
            "diagnostics",
            "recordings",
            "help",
            "recipes",
            "session",
            "sessions",
            "signin",
            "users",
        ),
        *("places", "static", "healthz", "readyz", "metrics", "gallery", "openapi.json"),
        *("wall", "panel"),
    }
)


class RootPath:
    """An ASGI layer that puts the root path before each path once."""

    def __init__(self, app: ASGIApp, root: str) -> None:
        """`root` is "" for that of the server."""
        self._app = app
        self._root = root

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] in ("http", "websocket"):
            of_server = scope.get("root_path", "")
            root = self._root or of_server.rstrip("/")
            if root:
                path = without(root, without(of_server, scope["path"]))
                raw = without(root, without(of_server, scope.get("raw_path", b"").decode("latin-1")))
                encoded = f"{root}{raw}".encode("latin-1")
                scope = {**scope, "root_path": root, "path": root + path, "raw_path": encoded}
        await self._app(scope, receive, send)


def without(prefix: str, path: str) -> str:
    """The path without a prefix of whole segments; at least "/"."""
    rest = path.removeprefix(prefix) if prefix else path
    return (rest or "/") if not rest or rest.startswith("/") else path


def path_of(scope: Scope) -> str:
    """The path as the routes have it."""
    return without(scope.get("root_path", ""), scope["path"])


def root_path_of(settings: Settings, server: ServerConfig | None) -> str:
    """The root path of the settings, else that of the server; SettingsError if the panel has such a
    path itself: it would not be known whether the proxy has taken it off."""
    root = settings.root_path or parse_root_path(server.root_path if server is not None else "")
    if root.split("/")[1:2] and root.split("/")[1] in OWN_PATHS:
        raise SettingsError(f'KIOSK_ROOT_PATH is "{root}": the panel has a path like this itself')
    return root

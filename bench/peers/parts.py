"""Common parts of peers: their processes, and a file server for pages without their own web server."""

import gzip
import html
import mimetypes
import os
import socket
import subprocess
import threading
from collections.abc import Callable, Mapping, Sequence
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Final

from bench.peer import Bare, Place, Running, until_answers
from tests.support.parts import Process, until

PEERS: Final = Path(__file__).resolve().parent
# The same as in bench/parts.py and the Makefile.
CACHE: Final = Path(os.environ.get("BENCH_CACHE") or Path.home() / ".cache/operator-panel/bench")
KIOSK_PYTHON: Final = CACHE / "kiosk/bin/python"
TOPICS_HERE: Final = "<!-- topics -->"


def started(command: Sequence[str | Path], env: Mapping[str, str], folder: Path) -> Process:
    """A server process; its stderr is in `text`."""
    own = {"PYTHONPATH": "", **env}
    return Process([str(part) for part in command], own, cwd=folder, stdout=subprocess.DEVNULL)


def serving(
    command: Sequence[str | Path], env: Mapping[str, str], place: Place, url: str, bare: Bare | None
) -> Running:
    """A peer that is one process; `url` is its page."""
    process = started(command, env, place.folder)
    end = ending(process.end)
    try:
        until_answers(url, lambda: process.running)
    except BaseException:
        end()
        raise
    return Running(url, (process.pid,), end, bare)


def uvicorn(app: Path, port: int) -> list[str | Path]:
    """The command that serves an `app.py` in this panel's environment. An open stream delays its
    shutdown by at most a second."""
    options = ["--port", str(port), "--log-level", "warning", "--timeout-graceful-shutdown", "1"]
    return [KIOSK_PYTHON, "-m", "uvicorn", "--app-dir", app, *options, "app:app"]


def with_topics(page: Path, topics: Sequence[str]) -> str:
    """A page with an element for each topic."""
    rows = (f'<p>{html.escape(t)}: <b data-topic="{html.escape(t)}"></b></p>' for t in topics)
    return page.read_text().replace(TOPICS_HERE, "\n".join(rows))


class Files:
    """A web server for a page and its scripts. It is not part of the peer and not measured: a thread,
    so that it starts at once."""

    def __init__(self, files: Mapping[str, bytes]) -> None:
        """`files`: by path; "/" is the page."""
        self._server = ThreadingHTTPServer(("127.0.0.1", 0), _handler(files))
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True)
        self._thread.start()
        self.url = f"http://127.0.0.1:{self._server.server_port}/"

    def end(self) -> None:
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()


def _handler(files: Mapping[str, bytes]) -> type[BaseHTTPRequestHandler]:
    packed = {path: gzip.compress(content) for path, content in files.items()}

    class Handler(BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"
        timeout = 5.0  # of an idle connection

        def do_GET(self) -> None:
            path = self.path.partition("?")[0]
            if path not in packed:
                self.send_error(404)
                return
            self.send_response(200)
            self.send_header("content-type", mimetypes.guess_type(path)[0] or "text/html")
            self.send_header("content-encoding", "gzip")
            self.send_header("content-length", str(len(packed[path])))
            self.end_headers()
            self.wfile.write(packed[path])

        def log_message(self, *_: object) -> None:
            pass

    return Handler


def with_page(
    process: Process,
    port: int,
    page: Path,
    scripts: Path,
    topics: Sequence[str],
    end: Callable[[], None],
    bare: Bare | None = None,
) -> Running:
    """A peer whose server on `port` is no web server. `Files` serves its page and the folder
    `scripts`."""
    try:
        until_listens(port, process)
        files = {f"/{path.name}": path.read_bytes() for path in scripts.iterdir()}
        served = Files({"/": with_topics(page, topics).encode(), **files})
    except BaseException:
        end()
        raise
    return Running(f"{served.url}?port={port}", (process.pid,), ending(end, served.end), bare)


def until_listens(port: int, process: Process) -> None:
    """Waits until a server listens that has no HTTP."""

    def listens() -> bool:
        assert process.running, process.text
        with socket.socket() as probe:
            return probe.connect_ex(("127.0.0.1", port)) == 0

    until(listens, "the server listens", within_s=20.0, every_s=0.005)


def ending(*ends: Callable[[], object]) -> Callable[[], None]:
    """A function that calls all of these in order, even if one raises."""

    def end() -> None:
        failures = []
        for end in ends:
            try:
                end()
            except Exception as failure:
                failures.append(failure)
        if failures:
            raise ExceptionGroup("what did not end", failures)

    return end

"""A page of another origin that shows the panel in a frame."""

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer


@contextmanager
def embedding_page(port: int, panel: str) -> Iterator[str]:
    """The URL of a page with a frame that shows `panel`, on a host name of its own: another site."""
    page = f'<!doctype html><title>Dashboard</title><iframe name="panel" src="{panel}" '
    page += 'width="1200" height="700"></iframe>'

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response(200)
            self.send_header("content-type", "text/html")
            self.end_headers()
            self.wfile.write(page.encode())

        def log_message(self, *_: object) -> None:
            pass

    with ThreadingHTTPServer(("127.0.0.1", port), Handler) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        try:
            yield f"http://localhost:{port}"
        finally:
            server.shutdown()
            thread.join()

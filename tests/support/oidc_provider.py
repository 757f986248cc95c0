"""A small OpenID Connect provider: it checks codes, secrets and PKCE, and can be wrong."""

import base64
import json
import secrets
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any, Final
from urllib.parse import parse_qs, unquote, urlencode, urlsplit

from authlib.oauth2.rfc7636 import create_s256_code_challenge
from joserfc import jwt
from joserfc.jwk import KeySet, RSAKey

CLIENT: Final = "panel1"
SECRET: Final = "canary-client-secret"


class Provider:
    """`claims` go into the next ID tokens in place of the right ones; `status` is that of every answer.
    `forms` are the requests for tokens, `asked` the last request for a sign-in. With `ends_sessions` it
    has an address for sign-outs."""

    def __init__(self, url: str) -> None:
        self.url = url
        self.key = RSAKey.generate_key(2048, {"kid": "first", "use": "sig", "alg": "RS256"})
        self.signs_with = self.key
        self.claims: dict[str, Any] = {}
        self.status = 200
        self.issuer = url
        self.forms: list[dict[str, str]] = []
        self.ends_sessions = True
        self.asked: dict[str, str] = {}
        self.ended: list[str] = []  # the `sub` of the sessions that were ended
        self._codes: dict[str, dict[str, str]] = {}

    def renew_key(self, kid: str) -> None:
        self.key = RSAKey.generate_key(2048, {"kid": kid, "use": "sig", "alg": "RS256"})
        self.signs_with = self.key

    def about(self) -> dict[str, Any]:
        names = {"authorization_endpoint": "auth", "token_endpoint": "token", "jwks_uri": "keys"}
        if self.ends_sessions:
            names["end_session_endpoint"] = "end"
        return {"issuer": self.issuer} | {name: f"{self.url}/{path}" for name, path in names.items()}

    def keys(self) -> dict[str, Any]:
        return dict(KeySet([self.key]).as_dict(private=False))

    def authorized(self, asked: dict[str, str]) -> str:
        """Where the browser goes when its user has signed in."""
        assert asked["response_type"] == "code"
        assert asked["code_challenge_method"] == "S256"
        assert asked["prompt"] == "login"
        self.asked = asked
        code = secrets.token_urlsafe(16)
        self._codes[code] = asked
        return f"{asked['redirect_uri']}?{urlencode({'code': code, 'state': asked['state']})}"

    def end(self, asked: dict[str, str]) -> str:
        """Where the browser goes after a sign-out here."""
        claims = jwt.decode(asked["id_token_hint"], self.key, ["RS256"]).claims
        assert claims["aud"] == asked["client_id"] == CLIENT
        self.ended.append(claims["sub"])
        return asked["post_logout_redirect_uri"]

    def token(self, form: dict[str, str], authorization: str) -> dict[str, Any] | None:
        """The tokens for a code, once; None for a wrong one."""
        self.forms.append(form)
        pair = base64.b64decode(authorization.removeprefix("Basic ")).decode().partition(":")
        asked = self._codes.pop(form.get("code", ""), None)
        if asked is None or (unquote(pair[0]), unquote(pair[2])) != (CLIENT, SECRET):
            return None
        if asked["redirect_uri"] != form["redirect_uri"]:
            return None
        if create_s256_code_challenge(form["code_verifier"]) != asked["code_challenge"]:
            return None
        now = int(time.time())
        right = {
            "iss": self.issuer, "aud": asked["client_id"], "sub": "1", "nonce": asked["nonce"],
            "iat": now, "exp": now + 300, "preferred_username": "sato", "groups": ["line1"],
        }  # fmt: skip
        claims = {name: value for name, value in (right | self.claims).items() if value is not None}
        header = {"alg": "RS256", "kid": self.signs_with.kid}
        id_token = jwt.encode(header, claims, self.signs_with)
        return {"access_token": "a", "token_type": "Bearer", "id_token": id_token}


@contextmanager
def provider(host: str = "127.0.0.1") -> Iterator[Provider]:
    """`host` is its name for browsers: "localhost" is another site than the panel's 127.0.0.1."""

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            parts = urlsplit(self.path)
            asked = {name: values[0] for name, values in parse_qs(parts.query).items()}
            if parts.path in ("/auth", "/end"):
                leads = mine.authorized(asked) if parts.path == "/auth" else mine.end(asked)
                self.send_response(303)
                self.send_header("location", leads)
                self.end_headers()
            else:
                self._answer(mine.keys() if parts.path == "/keys" else mine.about())

        def do_POST(self) -> None:
            body = self.rfile.read(int(self.headers["content-length"])).decode()
            form = {name: values[0] for name, values in parse_qs(body).items()}
            self._answer(mine.token(form, self.headers.get("authorization", "")))

        def _answer(self, content: dict[str, Any] | None) -> None:
            text = json.dumps(content or {"error": "invalid_grant"}).encode()
            self.send_response(mine.status if content else 400)
            self.send_header("content-length", str(len(text)))
            self.end_headers()
            self.wfile.write(text)

        def log_message(self, format: str, *args: Any) -> None:
            """Says nothing."""

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    server.daemon_threads = True
    mine = Provider(f"http://{host}:{server.server_port}")
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.02})
    thread.start()
    try:
        yield mine
    finally:
        server.shutdown()
        server.server_close()
        thread.join()

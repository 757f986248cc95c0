"""The editor beyond this machine: engineers sign in, and nothing is open without."""

import asyncio
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import httpx
import pytest
from fastapi import FastAPI

from app.cell.people.edits import set_disabled
from app.cell.people.users_file import STATE, UsersFile
from app.system.settings import Settings
from app.tools.editor.server import editor_app
from tests.support.certificates import Certificates, make_certificates
from tests.support.editor import PANEL, EditorServer
from tests.support.parts import until
from tests.support.processes import command
from tests.support.processes.command import COMMAND
from tests.support.users import add_user

TOKEN: Final = "the-token"
PASSWORD: Final = "correct horse"
OPEN: Final = {"/sign-in", "/static/{revision}/{name:path}"}
# What the preview serves below its place.
OF_PREVIEW: Final = (
    *("/preview/", "/preview/pages/cell", "/preview/events", "/preview/state"),
    *("/preview/static/x/panel.css", "/preview/widgets/open", "/preview/log"),
)


class Client:
    """A browser, from an address."""

    def __init__(self, runner: asyncio.Runner, app: FastAPI, address: str) -> None:
        self._run = runner.run
        self.app, self.address = app, address
        transport = httpx.ASGITransport(app, client=(address, 50_000))
        self.http = httpx.AsyncClient(transport=transport, base_url="https://127.0.0.1")

    def request(self, method: str, path: str, **about: Any) -> httpx.Response:
        return self._run(self.http.request(method, path, **about))

    def get(self, path: str, **about: Any) -> httpx.Response:
        return self.request("GET", path, **about)

    def post(self, path: str, **about: Any) -> httpx.Response:
        return self.request("POST", path, **about)

    def opens_socket(self, path: str) -> list[str]:
        """The types of the messages that answer the opening of a WebSocket."""
        cookies = "; ".join(f"{name}={value}" for name, value in self.http.cookies.items())
        headers = [(b"host", b"127.0.0.1"), (b"cookie", cookies.encode())]
        headers += [(b"origin", b"https://127.0.0.1"), (b"sec-fetch-site", b"same-origin")]
        scope: dict[str, Any] = {"type": "websocket", "scheme": "wss", "path": path}
        scope |= {"raw_path": path.encode(), "headers": headers, "query_string": b""}
        scope |= {"client": (self.address, 50_000)}
        sent: list[str] = []

        async def receive() -> Any:
            return {"type": "websocket.connect"}

        async def send(message: Any) -> None:
            sent.append(message["type"])

        self._run(self.app(scope, receive, send))
        return sent


class Desk:
    """An editor with users, in this process; each browser is a client that has the token."""

    def __init__(self, folder: Path, runner: asyncio.Runner) -> None:
        self._runner = runner
        self.users = folder / "users"
        add_user(self.users, "Ada", "engineer", password=PASSWORD, pin="2846")
        add_user(self.users, "Ben", "engineer", password=PASSWORD)
        add_user(self.users, "Olaf", "operator", password=PASSWORD)
        self.file = folder / "cell.toml"
        self.file.write_text(PANEL)
        self.app: FastAPI = editor_app(
            self.file, Settings.from_environment({}), token=TOKEN, port=1, users=self.users
        )
        self.state = self.app.state.editor.session.folder

    def browser(self, address: str = "192.0.2.7") -> Client:
        client = Client(self._runner, self.app, address)
        assert client.get(f"/?token={TOKEN}").status_code == 303
        return client

    def signed_in(self, name: str = "Ada") -> Client:
        client = self.browser()
        assert sign_in(client, name).status_code == 303
        return client

    def log(self) -> str:
        text: str = (self.state / "editor.log").read_text()
        return text


def sign_in(client: Client, name: str, secret: str = PASSWORD, **more: str) -> httpx.Response:
    return client.post("/sign-in", data={"name": name, "secret": secret, **more})


@pytest.fixture
def desk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Desk]:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    with asyncio.Runner() as runner:
        desk = Desk(tmp_path, runner)
        life = desk.app.router.lifespan_context(desk.app)
        runner.run(life.__aenter__())
        yield desk
        runner.run(life.__aexit__(None, None, None))


def test_nothing_is_open_without_a_sign_in_but_its_page_and_style(desk: Desk) -> None:
    client = desk.browser()
    paths = {
        (getattr(route, "path", ""), method)
        for route in desk.app.routes
        for method in getattr(route, "methods", None) or ("GET",)
    }
    assert len(paths) > 20
    paths |= {(path, method) for path in OF_PREVIEW for method in ("GET", "POST")}
    for template, method in sorted(paths):
        if template in OPEN:
            continue
        path = re.sub(r"\{[^}]*\}", "form", template)
        answer = client.request(method, path)
        assert answer.status_code == 401, (method, path)
        assert answer.json() == {"message": "You are signed out. Sign in to go on."}
    for path in ("/preview/socket", "/preview/frames", "/events"):
        assert client.opens_socket(path) == ["websocket.close"], path
    assert client.get("/", headers={"accept": "text/html"}).headers["location"] == "/sign-in"
    revision = desk.app.state.revision
    for name, status in (("editor.css", 200), ("editor/main.js", 401), ("../x", 401), ("x.css", 401)):
        assert client.get(f"/static/{revision}/{name}").status_code == status, name
    assert client.get(f"/static/{revision}/fonts/ibm-plex-sans-400.woff2").status_code == 200
    assert "/static/" in client.get("/sign-in").text


def test_token_of_the_address_is_needed_too(desk: Desk) -> None:
    stranger = desk.browser()
    stranger.http.cookies.clear()
    assert stranger.get("/sign-in").status_code == 403
    assert sign_in(stranger, "Ada").status_code == 403


def test_session_of_an_engineer_is_of_one_browser_and_ends(desk: Desk) -> None:
    client, other = desk.browser(), desk.browser()
    answer = sign_in(client, "Ada")
    assert answer.headers["location"] == "/"
    for word in ("Secure", "HttpOnly", "SameSite=strict"):
        assert word in answer.headers["set-cookie"]
    assert client.get("/state").status_code == 200
    assert "Ada: sign out" in client.get("/").text
    assert other.get("/state").status_code == 401
    value = client.http.cookies["panel_editor_user_1"]
    token, _, session = value.partition(".")
    for wrong in (f".{session}", f"{'0' * 32}.{session}", f"{token}.", token, "..", ""):
        other.http.cookies.set("panel_editor_user_1", wrong, "127.0.0.1")
        assert other.get("/state").status_code == 401, wrong
    assert client.post("/sign-out").headers["location"] == "/sign-in"
    client.http.cookies.set("panel_editor_user_1", value, "127.0.0.1")
    assert client.get("/state").status_code == 401


@pytest.mark.parametrize(
    ("form", "says"),
    [
        ({"name": "Ada", "secret": "wrong horse"}, "The user or the password is wrong."),
        ({"name": "None", "secret": PASSWORD}, "The user or the password is wrong."),
        ({"name": "Olaf", "secret": PASSWORD}, "Only an engineer can edit the panel file."),
        ({"name": "Ada", "secret": "2846", "way": "pin"}, "A PIN works only at the panel"),
        ({"name": "Ada", "secret": "2846"}, "The user or the password is wrong."),
        ({"name": "", "secret": PASSWORD}, "Choose a user."),
        ({"name": "<b>x", "secret": PASSWORD}, "The user or the password is wrong."),
        ({"name": "x" * 5000}, "Sign in with"),
    ],
)
def test_refused_sign_in_says_why(desk: Desk, form: dict[str, str], says: str) -> None:
    client = desk.browser()
    answer = client.post("/sign-in", data=form)
    assert answer.status_code in (401, 422)
    assert says in answer.text
    assert 'role="alert"' in answer.text
    assert "<b>x" not in answer.text
    assert client.get("/state").status_code == 401


def test_pin_is_taken_on_this_machine(desk: Desk) -> None:
    client = desk.browser("127.0.0.1")
    assert 'value="pin"' in client.get("/sign-in").text
    assert 'value="pin"' not in desk.browser().get("/sign-in").text
    assert sign_in(client, "Ada", "2846", way="pin").status_code == 303
    assert client.get("/state").status_code == 200


def test_failures_delay_the_next_try(desk: Desk) -> None:
    client = desk.browser()
    statuses = [sign_in(client, "Ada", f"wrong horse {number}").status_code for number in range(6)]
    assert statuses == [401, 401, 401, 401, 429, 429]
    late = sign_in(client, "Ada")
    assert late.status_code == 429
    assert "Too many failed sign-ins" in late.text
    assert "Sign-in refused: too many failures before." in desk.log()
    assert PASSWORD not in desk.log()
    assert "wrong horse" not in desk.log()


def test_disabled_engineer_is_signed_out_at_once(desk: Desk) -> None:
    client = desk.signed_in()
    file = UsersFile(desk.users)
    change = ("now", "disable", "Ada", "", "")
    file.edit(lambda book: set_disabled(book, "Ada", True, "now").with_change(*change))
    until(lambda: client.get("/state").status_code == 401, "Ada is signed out")
    # The panel's own server still has the change to log.
    assert not (desk.users / STATE).exists()
    assert (desk.state / STATE).exists()


def test_others_see_who_edits_and_the_log_who_saved(desk: Desk) -> None:
    ada, ben = desk.signed_in("Ada"), desk.signed_in("Ben")
    editor = desk.app.state.editor
    editor.browser("a", "Ada")
    path: list[Any] = ["page", 0, "group", 0, "widget", 0]
    assert ben.post("/selection", json={"browser": "a", "path": path}).status_code == 204
    assert editor.state("b")["others"] == []
    ada.post("/selection", json={"browser": "a", "path": path})
    (other,) = ben.get("/state", params={"browser": "b"}).json()["others"]
    assert (other["person"], other["tag"]) == ("Ada", "readout: speed")
    seen = ben.get("/state").json()["revision"]
    set_label = {"op": "set", "path": [*path, "label"]}
    for client, revision, label, status in ((ada, seen, "Belt", 200), (ben, seen, "Band", 409)):
        posted = {"revision": revision, "edits": [{**set_label, "value": label}], "label": "Label"}
        answer = client.post("/edits", json=posted)
        assert answer.status_code == status
    assert answer.json()["message"].startswith("Ada has changed")
    assert ben.post("/undo", json={}).status_code == 200
    assert [entry.author for entry in editor.session.history[-2:]] == ["Ada", "Ben"]
    assert ben.post("/redo", json={}).status_code == 200
    assert ada.post("/save", json={}).json()["saved"]
    assert "Ada has saved the file. Backup of before: 0001.toml." in desk.log()


@pytest.fixture(scope="module")
def certificates(tmp_path_factory: pytest.TempPathFactory) -> Certificates:
    return make_certificates(tmp_path_factory.mktemp("tls"))


def test_it_does_not_start_without_an_engineer(tmp_path: Path, certificates: Certificates) -> None:
    file, users = tmp_path / "cell.toml", tmp_path / "people"
    file.write_text(PANEL)
    tls = ["--ssl-certfile", str(certificates.server), "--ssl-keyfile", str(certificates.key)]
    start = (COMMAND, "edit", str(file), "--host", "0.0.0.0", *tls)
    for name in ("", "Olaf"):
        if name:
            add_user(users, name, "operator", password=PASSWORD)
        done = command.run(*start, "--users", str(users))
        assert done.returncode == 1
        assert f"users add NAME --role engineer --password-stdin --data {users}" in done.stderr
    add_user(users, "Pia", "engineer", pin="2846")
    assert command.run(*start, "--users", str(users)).returncode == 1
    (users / "users.json").write_text("{")
    done = command.run(*start, "--users", str(users))
    assert done.returncode == 1
    assert "users.json: " in done.stderr
    on_loopback = command.run(COMMAND, "edit", str(file), "--users", str(users))
    assert on_loopback.returncode == 1
    assert "--users goes with --host" in on_loopback.stderr


def test_stream_ends_with_its_session(tmp_path: Path, certificates: Certificates) -> None:
    add_user(tmp_path / "people", "Ada", "engineer", password=PASSWORD)
    tls = ("--ssl-certfile", str(certificates.server), "--ssl-keyfile", str(certificates.key))
    beyond = ("--host", "0.0.0.0", *tls, "--users", str(tmp_path / "people"))
    file = tmp_path / "cell.toml"
    file.write_text(PANEL)
    editor = EditorServer(file, *beyond, engineer=f"Ada:{PASSWORD}")
    try:
        with editor.http.stream("GET", "/events", params={"browser": "1"}) as stream:
            lines = stream.iter_lines()
            assert next(lines) == "event: state"
            assert editor.http.post("/sign-out").status_code == 303
            assert len([*lines]) < 20
        assert editor.http.get("/state").status_code == 401
    finally:
        editor.end()

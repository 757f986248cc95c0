"""Another release in place of the one that runs: it stays if it comes up, else that one is back."""

import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest

from app.tools.cli.command import main
from app.tools.install.host import Host, StepFailed
from app.tools.install.plan import ROUTER
from app.tools.install.release import RELEASES, Current, link_to, linked, release_name
from app.tools.install.update import Updater
from tests.tools.install.test_plan import make_wheel, path_on

pytestmark = pytest.mark.promise("kiosk")

UP = {"/healthz": (200, "ok"), "/": (200, "<p data-widget>"), "/readyz": (200, "ready")}
CUT = "cut off"  # the text of a response that ends before its length
Pages = Mapping[str, tuple[int, str]]


@dataclass
class Serving:
    """What serves after a start, by the release that is current then."""

    host: Host
    served: dict[str, Pages]
    pages: Pages = field(default_factory=dict)
    restarts: int = 0
    fails: int = 0  # so many restarts from now on

    def restart(self) -> None:
        self.restarts += 1
        if self.fails:
            self.fails -= 1
            raise StepFailed("systemctl failed")
        self.pages = self.served[linked(self.host, "current")]


@contextmanager
def serving(services: Serving) -> Iterator[str]:
    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            status, text = services.pages.get(self.path, (503, ""))
            self.send_response(status)
            if text == CUT:
                self.send_header("Content-Length", "1000")
            self.end_headers()
            self.wfile.write(text.encode())

        def log_message(self, *_: object) -> None:
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.01,))
        thread.start()
        try:
            yield f"http://127.0.0.1:{server.server_port}"
        finally:
            server.shutdown()
            thread.join()


class Machine:
    """A folder with two releases, the first of which runs."""

    def __init__(self, folder: Path, after: Pages, before: Pages = UP) -> None:
        self.host = Host(folder / "root")
        self.wheels = [make_wheel(folder / f"{n}", f"0.{n}.0") for n in (1, 2)]
        self.first, self.second = map(release_name, self.wheels)
        for wheel, name in zip(self.wheels, (self.first, self.second), strict=True):
            release = path_on(self.host, f"{RELEASES}/{name}")
            (release / "bin").mkdir(parents=True)
            (release / wheel.name).write_bytes(wheel.read_bytes())
            (release / ".complete").touch()
            program = release / "bin/operator-panel"
            program.write_text("#!/bin/sh\n")
            program.chmod(0o755)
        link_to(self.host, "current", self.first)
        self.services = Serving(self.host, {self.first: before, self.second: after})
        self.services.restart()
        self.said: list[str] = []

    @property
    def runs(self) -> str:
        return linked(self.host, "current")

    def update(self, back: bool = False) -> None:
        with serving(self.services) as url:
            updater = Updater(
                host=self.host,
                services=self.services,
                url=url,
                say=self.said.append,
                comes_within_s=0.2,
                stays_s=0.0,
            )
            if back:
                updater.back()
            else:
                updater._switch(self.second)


def test_a_release_that_comes_up_stays(tmp_path: Path) -> None:
    machine = Machine(tmp_path, UP)
    machine.update()
    assert machine.runs == machine.second
    assert path_on(machine.host, "/etc/systemd/system/operator-panel.service").exists()


@pytest.mark.parametrize(
    ("missing", "why"),
    [
        ("/healthz", "the server does not answer"),
        ("/", "its page does not come"),
        ("/readyz", "/readyz is not 200 as it was before"),
    ],
)
def test_release_that_does_not_start_is_rolled_back(tmp_path: Path, missing: str, why: str) -> None:
    machine = Machine(tmp_path, {path: page for path, page in UP.items() if path != missing})
    with pytest.raises(StepFailed, match=why) as raised:
        machine.update()
    assert str(raised.value).endswith(f"{machine.first} runs again")
    assert machine.runs == machine.first
    assert machine.services.pages == UP
    assert linked(machine.host, "previous") == ""
    assert not path_on(machine.host, f"{RELEASES}/{machine.second}").exists()


def test_a_page_without_widgets_is_no_page(tmp_path: Path) -> None:
    machine = Machine(tmp_path, {**UP, "/": (200, "an error")})
    with pytest.raises(StepFailed, match="its page does not come"):
        machine.update()
    assert machine.runs == machine.first


def test_a_robot_that_was_off_before_may_be_off_after(tmp_path: Path) -> None:
    off = {**UP, "/readyz": (503, "no bridge")}
    machine = Machine(tmp_path, off, before=off)
    machine.update()
    assert machine.runs == machine.second


def test_rollback_by_command_starts_the_previous_release(tmp_path: Path) -> None:
    machine = Machine(tmp_path, UP)
    machine.update()
    machine.update(back=True)
    assert machine.runs == machine.first
    machine.update(back=True)
    assert machine.runs == machine.second


def test_without_a_release_before_there_is_no_way_back(tmp_path: Path) -> None:
    machine = Machine(tmp_path, UP)
    with pytest.raises(StepFailed, match="there is no release before this one"):
        machine.update(back=True)
    Current(machine.first).do(machine.host)


def test_both_that_do_not_come_up_are_named(tmp_path: Path) -> None:
    machine = Machine(tmp_path, {})
    machine.services.served[machine.first] = {}
    with pytest.raises(StepFailed, match=f"nor does {machine.first}"):
        machine.update()
    assert machine.runs == machine.first


def test_a_start_that_fails_is_undone_too(tmp_path: Path) -> None:
    machine = Machine(tmp_path, UP)
    machine.services.fails = 1
    with pytest.raises(StepFailed, match="systemctl failed") as raised:
        machine.update()
    assert str(raised.value).endswith(f"{machine.first} runs again")
    assert machine.runs == machine.first


def test_a_response_that_is_cut_off_is_none(tmp_path: Path) -> None:
    machine = Machine(tmp_path, {**UP, "/": (200, CUT)})
    with pytest.raises(StepFailed, match="its page does not come"):
        machine.update()
    assert machine.runs == machine.first


def test_a_proxy_is_not_used_for_this_machine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("http_proxy", "http://127.0.0.1:1")
    machine = Machine(tmp_path, UP)
    machine.update()
    assert machine.runs == machine.second


@pytest.mark.parametrize("good", [False, True])
def test_only_an_update_that_is_good_takes_the_place_of_the_way_back(
    tmp_path: Path, good: bool
) -> None:
    machine = Machine(tmp_path, UP if good else {})
    older = path_on(machine.host, f"{RELEASES}/0.0.1-a")
    older.mkdir()
    link_to(machine.host, "previous", older.name)
    with nullcontext() if good else pytest.raises(StepFailed):
        machine.update()
    assert linked(machine.host, "previous") == (machine.first if good else older.name)
    assert older.exists() is not good


def test_an_address_that_is_none_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["update", "--url", "127.0.0.1:8000"])
    assert '"127.0.0.1:8000" is not the address of a server, like http://' in capsys.readouterr().err


def test_the_unit_of_the_router_is_renewed_where_there_is_one(tmp_path: Path) -> None:
    machine = Machine(tmp_path, UP)
    unit = path_on(machine.host, f"/etc/systemd/system/{ROUTER}")
    machine.update()
    assert not unit.exists()
    unit.write_text("[Unit]\nDescription=of an earlier release\n")
    machine.update()
    assert "zenohd --config" in unit.read_text()

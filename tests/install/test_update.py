"""Another release in place of the one that runs: it stays if it comes up, else that one is back."""

import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest

from app.install.host import Host, StepFailed
from app.install.release import RELEASES, Current, link_to, linked, release_name
from app.install.update import Updater
from tests.install.test_plan import make_wheel

UP = {"/healthz": (200, "ok"), "/": (200, "<p data-widget>"), "/readyz": (200, "ready")}
Pages = Mapping[str, tuple[int, str]]


@dataclass
class Serving:
    """What serves after a start, by the release that is current then."""

    host: Host
    served: dict[str, Pages]
    pages: Pages = field(default_factory=dict)
    restarts: int = 0

    def restart(self) -> None:
        self.restarts += 1
        self.pages = self.served[linked(self.host, "current")]


@contextmanager
def serving(services: Serving) -> Iterator[str]:
    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            status, text = services.pages.get(self.path, (503, ""))
            self.send_response(status)
            self.end_headers()
            self.wfile.write(text.encode())

        def log_message(self, *_: object) -> None:
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.01,))
        thread.start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()
        thread.join()


class Machine:
    """A folder with two releases, the first of which runs."""

    def __init__(self, folder: Path, after: Pages, before: Pages = UP) -> None:
        self.host = Host(folder / "root")
        self.wheels = [make_wheel(folder / f"{n}", f"0.{n}.0") for n in (1, 2)]
        self.first, self.second = map(release_name, self.wheels)
        for wheel, name in zip(self.wheels, (self.first, self.second), strict=True):
            release = self.host.path(f"{RELEASES}/{name}")
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
    assert machine.host.path("/etc/systemd/system/operator-panel.service").exists()


@pytest.mark.parametrize(
    ("missing", "why"),
    [
        ("/healthz", "the server does not answer"),
        ("/", "its page does not come"),
        ("/readyz", "/readyz is not 200 as it was before"),
    ],
)
def test_what_does_not_come_up_is_replaced_by_the_release_before(
    tmp_path: Path, missing: str, why: str
) -> None:
    machine = Machine(tmp_path, {path: page for path, page in UP.items() if path != missing})
    with pytest.raises(StepFailed, match=why) as raised:
        machine.update()
    assert str(raised.value).endswith(f"{machine.first} runs again")
    assert machine.runs == machine.first
    assert machine.services.pages == UP
    assert linked(machine.host, "previous") == ""
    assert not machine.host.path(f"{RELEASES}/{machine.second}").exists()


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


def test_it_goes_back_by_hand(tmp_path: Path) -> None:
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

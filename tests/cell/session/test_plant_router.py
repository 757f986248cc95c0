"""Real routers of a plant over TLS, with what `operator-panel router-config --cell --wall` writes: what
a cell and a wall may do passes, in both directions, and nothing else."""

import re
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any, Final

import pytest
import zenoh

from app.ros.zenoh.site import alive_key, summary_key
from app.tools.cli.command import main
from tests.support.cells import payload
from tests.support.certificates import tls_session
from tests.support.parts import free_port, until
from tests.support.rmw import Router

pytestmark = pytest.mark.promise("neighbours")

PANEL: Final = """
title = "Cell"
[site]
name = "line 2"
cell = "{cell}"
[[page]]
id = "main"
title = "Main"
"""
ONE: Final = summary_key("line 2", "cell 1")
TWO: Final = summary_key("line 2", "cell 2")
ROBOT: Final = "robot2/cmd_vel"


def command(*words: object) -> None:
    assert main([str(word) for word in words]) == 0


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The certificates of two cells, a wall, two routers and someone else, by one CA."""
    path = tmp_path_factory.mktemp("plant")
    for cell in ("cell 1", "cell 2"):
        (path / f"{cell.replace(' ', '')}.toml").write_text(PANEL.format(cell=cell))
    pki = path / "pki"
    command("pki", "new", pki, "--panel", path / "cell1.toml", "--host", "127.0.0.1")
    command("pki", "add", pki, "cell2", "--client", "--common-name", "cell2-kiosk")
    for name in ("wall1", "stranger"):
        command("pki", "add", pki, name, "--client")
    for name in ("router1", "router2"):
        command("pki", "add", pki, name, "--host", "127.0.0.1")
        command("pki", "add", pki, f"{name}-client", "--client", "--common-name", name)
    return path


@pytest.fixture(scope="module")
def plant(zenohd: None, folder: Path) -> Iterator[tuple[str, str]]:
    """The endpoints of two routers: the cells come to the first, walls to the second."""
    first, second = (f"tls/127.0.0.1:{free_port()}" for _ in range(2))
    cells = [f"--cell={folder}/cell1.toml", f"--cell={folder}/cell2.toml=cell2-kiosk"]
    started = []
    for name, listen, connect in (("router1", first, ""), ("router2", second, first)):
        other = "router2" if name == "router1" else "router1"
        file = folder / f"{name}.json5"
        options = ["--listen", listen, "--tls", folder / "pki", "--certificate", name, "-o", file]
        options += ["--connect", connect] if connect else []
        command("router-config", *cells, "--wall", "wall1", "--router", other, *options)
        router = Router()
        router.configure(file)
        router.start()
        started.append(router)
    yield first, second
    for router in started:
        router.end()


class Client:
    """A client with a certificate, and all that it has been sent."""

    def __init__(self, endpoint: str, folder: Path, name: str) -> None:
        self.session = tls_session(endpoint, folder / "pki", name)
        self.heard: list[str] = []
        self.asked: list[str] = []
        self.tokens: list[str] = []
        self._held: list[Any] = []

    def listen(self) -> "Client":
        """To all that there may be, by wide and by exact key expressions."""
        remote = zenoh.Locality.REMOTE
        for key in ("**", summary_key(), ONE, TWO, ROBOT, "robot2/**"):
            self._held.append(self.session.declare_subscriber(key, self._hear, allowed_origin=remote))
        for key in ("**", alive_key()):
            live = self.session.liveliness().declare_subscriber(key, self._token, history=True)
            self._held.append(live)
        return self

    def serve(self, key: str, content: bytes) -> "Client":
        def answer(query: zenoh.Query) -> None:
            with query:
                self.asked.append(str(query.selector))
                query.reply(key, content)

        self._held.append(self.session.declare_queryable(key, answer))
        self._held.append(self.session.liveliness().declare_token(f"{key}/alive"))
        self._held.append(self.session.declare_publisher(key))
        return self

    def _hear(self, sample: zenoh.Sample) -> None:
        self.heard.append(f"{sample.key_expr}: {sample.payload.to_bytes()[:20].decode()}")

    def _token(self, sample: zenoh.Sample) -> None:
        self.tokens.append(str(sample.key_expr))


@pytest.fixture
def client(folder: Path, plant: tuple[str, str]) -> Iterator[Callable[..., Client]]:
    opened: list[Client] = []

    def opening(name: str, at: int = 0) -> Client:
        opened.append(Client(plant[at], folder, name))
        return opened[-1]

    yield opening
    for each in opened:
        each.session.close()


def test_a_summary_passes_to_a_wall_at_another_router(client: Callable[..., Client]) -> None:
    cell = client("kiosk").serve(ONE, payload("line 2", "cell 1"))
    wall = client("wall1", at=1).listen()
    until(lambda: wall.tokens == [alive_key("line 2", "cell 1")] * 2, "its token")

    def put() -> bool:
        cell.session.put(ONE, b"now")
        return f"{ONE}: now" in wall.heard

    until(put, "its summary")

    def whole() -> list[bytes]:
        answers = wall.session.get(summary_key(), timeout=5.0)
        return [answer.ok.payload.to_bytes() for answer in answers if answer.ok]

    until(lambda: whole() == [payload("line 2", "cell 1")], "the whole, to a query")


def test_a_cell_sees_no_other_cell_and_publishes_only_its_own(client: Callable[..., Client]) -> None:
    two = client("cell2").listen().serve(TWO, b"two")
    wall = client("wall1").listen()
    first = client("kiosk").listen()

    def put() -> bool:
        first.session.put(TWO, b"forged")  # as the other cell
        first.session.put(ROBOT, b"move")  # to the other cell's robot
        first.session.put(ONE, b"own")  # in the order of the connection: the last passes
        two.session.put(ROBOT, b"state")
        two.session.put(TWO, b"two")
        return f"{ONE}: own" in wall.heard and f"{TWO}: two" in wall.heard

    until(put, "both summaries are there")
    assert not any("forged" in each or ROBOT in each for each in wall.heard)
    assert first.heard == []
    assert two.heard == []
    assert first.tokens == []
    # Nor does it get an answer of the other cell, or a token in its name.
    answers = [answer.ok for answer in first.session.get(TWO, timeout=2.0) if answer.ok]
    assert answers == []
    forged = first.session.liveliness().declare_token(alive_key("line 2", "cell 2x"))
    own = first.session.liveliness().declare_token(alive_key("line 2", "cell 1"))
    until(lambda: alive_key("line 2", "cell 1") in wall.tokens, "its own token")
    assert alive_key("line 2", "cell 2x") not in wall.tokens
    del forged, own


def test_a_wall_publishes_nothing(client: Callable[..., Client]) -> None:
    cell = client("kiosk").listen().serve(ONE, b"one")
    other = client("wall1", at=1).listen()
    wall = client("wall1")
    held = [
        wall.session.declare_queryable(TWO, lambda query: query.drop()),
        wall.session.liveliness().declare_token(alive_key("line 2", "cell 9")),
    ]

    def put() -> bool:
        for key in (ONE, TWO, ROBOT, "operator-panel/x/y/z", "@/admin"):
            wall.session.put(key, b"forged")
        cell.session.put(ONE, b"own")
        return f"{ONE}: own" in other.heard

    until(put, "what the cell publishes is there")
    assert [each for each in (*other.heard, *cell.heard) if "forged" in each] == []
    assert alive_key("line 2", "cell 9") not in other.tokens
    del held


def test_a_certificate_that_is_not_named_may_do_nothing(client: Callable[..., Client]) -> None:
    cell = client("kiosk").serve(ONE, b"one")
    wall = client("wall1").listen()
    stranger = client("stranger").listen()

    def put() -> bool:
        stranger.session.put(ONE, b"forged")
        cell.session.put(ONE, b"own")
        return f"{ONE}: own" in wall.heard

    until(put, "the cell's own is there")
    assert not any("forged" in each for each in wall.heard)
    assert (stranger.heard, stranger.tokens) == ([], [])


def test_no_one_without_a_certificate_gets_in(plant: tuple[str, str], folder: Path) -> None:
    with pytest.raises(zenoh.ZError), closing(tls_session(plant[0], folder / "pki")):
        pass


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (["--cell", "{cell}", "--wall", "w"], "can't be told apart"),
        (["{cell}", "--wall", "w"], "without a PANEL"),
        (["--cell", "{cell}", "--cell", "{cell}"], "the same names"),
        (["--cell", "{none}"], r"has no \[site\]"),
        (["--cell", "=x"], "is not a panel file"),
    ],
)
def test_mistakes_are_named(
    words: list[str], reason: str, folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    none = tmp_path / "none.toml"
    none.write_text('title = "x"\n[[page]]\nid = "main"\ntitle = "Main"\n')
    arguments = [word.format(cell=folder / "cell1.toml", none=none) for word in words]
    with pytest.raises(SystemExit):
        main(["router-config", *arguments])
    assert re.search(reason, capsys.readouterr().err)


def test_without_certificates_walls_alone_may_read(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    command("router-config", "--wall", "any")
    written = capsys.readouterr().out
    assert '"put", "reply"' in written
    assert '["ingress"]' in written
    assert zenoh.Config.from_json5(written)

"""This project as a peer: its wheel as shipped, with the operator's log and an interlock."""

import os
import subprocess
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from bench.parts import COMMAND, ENABLED, KIOSK_PYTHON, end_process
from bench.peer import Bare, Peer, Place, Running, until_answers
from tests.support.parts import free_port, zenoh_file

HEAD: Final = f"""
title = "Benchmark"
mode = "live"

[[interlock]]
id = "operation"
topic = "{ENABLED}"
type = "std_msgs/msg/Bool"
field = "data"
"""
PAGE: Final = """
[[page]]
id = "operation"
title = "Operation"

[[page.widget]]
id = "text"
kind = "text"
label = "Message"
max_length = 80
"""
BUTTON: Final = """
[[page.widget]]
id = "operation{n}"
kind = "publish"
label = "Publish{n}"
topic = "{topic}"
type = "std_msgs/msg/String"
message = {{ data = "{{text}}" }}
interlock = "operation"
"""
READOUT: Final = """
[[page.widget]]
id = "{id}"
kind = "readout"
label = "{id}"
topic = "{topic}"
type = "{type}"
"""
TEXT: Final = "std_msgs/msg/String"
ROBOT: Final = """
[[robot]]
id = "{id}"
name = "{id}"
namespace = "/{id}"
connect = ["{locator}"]
"""


@dataclass(frozen=True)
class Robot:
    """One of several robots: its namespace without the slash, and its Zenoh locator."""

    id: str
    locator: str


def panel(
    topics: Sequence[str],
    buttons: int = 1,
    widgets: int = 0,
    robots: Sequence[Robot] = (),
    dialect: str = "",
) -> str:
    """A panel file with a readout for each topic, and in total `widgets` readouts of the first
    topic."""

    def parts() -> Iterator[str]:
        if dialect:
            yield f'dialect = "{dialect}"'
        yield HEAD
        for robot in robots:
            yield ROBOT.format(id=robot.id, locator=robot.locator)
        yield PAGE
        for n in range(1, buttons + 1):
            yield BUTTON.format(n=n, topic=COMMAND)
        for topic in topics:
            yield READOUT.format(id=topic[1:], topic=topic, type=TEXT)
        for n in range(1, widgets):
            yield READOUT.format(id=f"more{n}", topic=topics[0], type=TEXT)

    return "".join(parts())


@dataclass(frozen=True)
class Kiosk(Peer):
    """This panel; `widgets`, `robots` and `dialect` as in `panel`."""

    id: str = "kiosk"
    title: str = "this panel"
    shown: str = '[data-widget="operation1"] button'
    button: str = '[data-widget^="operation"] button[formaction]'
    widgets: int = 0
    robots: tuple[Robot, ...] = ()
    dialect: str = ""

    def start(self, place: Place) -> Running:
        file = place.folder / "panel.toml"
        file.write_text(panel(place.topics, place.buttons, self.widgets, self.robots, self.dialect))
        port = free_port()
        env = {
            "KIOSK_PANEL": str(file),
            "KIOSK_ZENOH": str(zenoh_file(place.folder, place.router)),
            "KIOSK_DATA": str(place.folder / "data"),
            "PYTHONPATH": "",
        }
        log = place.folder / "kiosk.log"
        process = _started(
            [KIOSK_PYTHON, "-m", "uvicorn", "app.main:app", "--port", str(port)], env, log
        )
        url = f"http://127.0.0.1:{port}"
        try:
            until_answers(f"{url}/healthz", lambda: process.poll() is None)
        except BaseException as error:
            end_process(process)
            error.add_note(log.read_text()[-2000:])
            raise
        base = f"/robots/{self.robots[0].id}" if self.robots else ""
        bare = Bare("events", f"{base}/events")
        return Running(f"{url}{base}/", (process.pid,), lambda: end_process(process), bare)


def _started(
    command: Sequence[str | Path], env: dict[str, str], log: Path
) -> "subprocess.Popen[bytes]":
    """Starts a process in its own session, so that Ctrl-C reaches only the harness."""
    with log.open("wb") as out:
        return subprocess.Popen(
            command,
            cwd=log.parent,  # not the checkout: its modules would shadow the installed ones
            env={**os.environ, **env},
            stdin=subprocess.DEVNULL,
            stdout=out,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )

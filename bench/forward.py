"""`python -m bench.forward`: whether a press waits for the forwarder.

A data folder has an operator's log of 100,000 entries. In turn, the server runs without a central
database, and with one that lacks all of them: a real PostgreSQL, which gets them meanwhile. Presses
go on all the time, as fast as one client may. Prints a table and writes it into forward.md; with
`QUICK=1` in some seconds, and without writing. Needs Debian's postgresql and no bridge.
"""

import os
import shutil
import tempfile
import time
import uuid
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

from app.tools.central.schema import database, upgrade
from bench.parts import cpu_s, rss_mib
from bench.report.figures import percentile
from tests.support.cell_data import CellData
from tests.support.parts import ROOT, Server, until
from tests.support.postgres import WRITER, Cluster, add_logins, cluster, new_database, query
from tests.support.servers import demo_server

QUICK: Final = bool(os.environ.get("QUICK"))
ENTRIES: Final = 5_000 if QUICK else 100_000
ROUNDS: Final = 1 if QUICK else 3
LEAST_S: Final = 3.0 if QUICK else 20.0
PAUSE_S: Final = 0.03  # between two presses: fewer than a client may
WARM: Final = 20
PAGE: Final = Path(__file__).parent / "forward.md"
PANEL: Final = """title = "Cell"
[[page]]
id = "main"
title = "Main"
[[page.widget]]
id = "start"
kind = "publish"
label = "Start"
topic = "/operation1"
type = "std_msgs/msg/String"
message = { data = "go" }
"""
HEAD: Final = ("", "presses", "p50 ms", "p99 ms", "longest ms", "CPU of the server", "memory MiB")


def main() -> None:
    rows = []
    for values in measured():
        print(*values, flush=True)
        rows.append(values)
    table = "\n".join(f"| {' | '.join(map(str, row))} |" for row in (HEAD, ("---",) * len(HEAD), *rows))
    print(table)
    if not QUICK:
        about = PAGE.read_text().partition("<!-- table -->")[0] if PAGE.exists() else ""
        PAGE.write_text(f"{about}<!-- table -->\n{table}\n")


def measured() -> Iterator[tuple[Any, ...]]:
    """A row for each round with and without, then both together."""
    every: dict[bool, list[float]] = {False: [], True: []}
    with (
        tempfile.TemporaryDirectory(prefix="bench-forward-") as name,
        cluster(is_elsewhere=True) as postgres,
    ):
        folder = Path(name)
        filled = CellData(folder / "filled")
        for _ in range(ENTRIES // 1000):
            filled.press(1000, 0.5, "refused")
        filled.sign()
        filled.close()
        for number in range(ROUNDS):
            for sends in (False, True) if number % 2 == 0 else (True, False):
                took, about = measured_round(folder, postgres, sends)
                every[sends] += took
                yield row(f"round {number + 1}, {'sending' if sends else 'without'}", took, about)
        for sends, took in every.items():
            yield row("all, sending" if sends else "all, without", took, ("", ""))


def row(name: str, took: list[float], about: tuple[str, str]) -> tuple[Any, ...]:
    figures = (percentile(took, 50), percentile(took, 99), max(took))
    return (name, len(took), *(f"{value:.2f}" for value in figures), *about)


def measured_round(folder: Path, postgres: Cluster, sends: bool) -> tuple[list[float], tuple[str, str]]:
    """The times of presses in ms, until all entries are sent and for `LEAST_S` at least."""
    data = folder / "data"
    shutil.rmtree(data, ignore_errors=True)
    shutil.copytree(folder / "filled", data)
    settings = {}
    if sends:
        new_database(postgres)
        with database(postgres.config()) as db:
            upgrade(db, new=True)
        add_logins(postgres, cell1=WRITER)
        file = folder / "forward.toml"
        file.write_text(
            f'[forward]\npanel = "cell 1"\nconnection = "{postgres.string("cell1")}"\n'
            f'password_file = "{postgres.folder}/cell-password"\n'
        )
        settings["KIOSK_FORWARD"] = str(file)
    with demo_server(folder, PANEL, KIOSK_DATA=str(data), **settings) as server:
        until(server.ready, "ready", 60)
        press(server, WARM)
        pid = server.process.pid
        began, used = time.monotonic(), cpu_s([pid])
        took: list[float] = []
        while not has_enough(postgres, sends, time.monotonic() - began):
            took += press(server, 100)
        share = (cpu_s([pid]) - used) / (time.monotonic() - began)
        return took, (f"{100 * share:.1f} %", f"{rss_mib([pid]):.0f}")


def has_enough(postgres: Cluster, sends: bool, passed_s: float) -> bool:
    if passed_s < LEAST_S:
        return False
    if not sends:
        return True
    (count,) = query(postgres, "SELECT count(*) FROM operator_panel.log")[0]
    return bool(count >= ENTRIES)


def press(server: Server, count: int) -> list[float]:
    """The times of so many presses, in ms."""
    took = []
    for _ in range(count):
        began = time.monotonic()
        answer = server.http.post("/widgets/start", json={"id": uuid.uuid4().hex, "inputs": {}})
        took.append(1000 * (time.monotonic() - began))
        assert answer.json()["outcome"] == "published", answer.text
        time.sleep(PAUSE_S)
    return took


if __name__ == "__main__":
    assert ROOT.exists()
    main()

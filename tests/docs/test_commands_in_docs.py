"""Each shell command that README and documentation show is run by a test, or it is said why not: see
commands_in_docs.toml."""

from collections.abc import Iterator
from pathlib import Path
from typing import Final

import pytest

from tests.docs.test_tutorial import STEPS
from tests.support.parts import ROOT, Process, until
from tests.support.processes.shell import Shell
from tests.support.shown_commands import TABLE, Row, Shown, beside, commands_of, row_of, rows, shown
from tests.tools.simulator.test_replay import mcap_file

pytestmark = pytest.mark.promise("documents")

RECORDING: Final = "cell1-2026-05-04.mcap"


def runs() -> list[tuple[Row, Shown]]:
    """Each command that is run here, once; those with the same beside them follow one another, and come
    after what runs beside them."""
    once = {command.command: command for command in reversed(shown())}
    rows_run = [
        (row, command)
        for command in once.values()
        if (row := row_of(command.command)) and row.kind == "run"
    ]
    order = rows()

    def place(pair: tuple[Row, Shown]) -> tuple[str, bool, int]:
        row, command = pair
        needed = row.text("beside")
        return needed or runs_beside(command.command), bool(needed), order.index(row)

    return sorted(rows_run, key=place)


def runs_beside(command: str) -> str:
    """The name of what is beside commands, and started by this command; "" for none."""
    names = {row.text("beside") for row in rows()}
    return next((name for name in names if name and beside()[name]["command"] == command), "")


class Machine:
    """The shell, and what runs beside its commands."""

    def __init__(self, folder: Path) -> None:
        self.shell = Shell(folder)
        self._name = ""
        self.running: Process | None = None
        # `checkout` has links to the repository's files: these are its own.
        (self.shell.checkout / "cell1.toml").write_text(STEPS[-1])
        mcap_file(folder).rename(self.shell.checkout / RECORDING)

    def beside(self, name: str) -> None:
        """Has that run and nothing else; "" is nothing."""
        if name == self._name:
            return
        if self.running is not None:
            self.shell.interrupt(self.running)
            self.running = None
        if name:
            self.running = self.shell.start(**_command(name))
        self._name = name


def _command(name: str) -> dict[str, str]:
    return {"command": beside()[name]["command"], "ready": beside()[name]["until"]}


@pytest.fixture(scope="module")
def machine(namespaces: None, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Machine]:
    mine = Machine(tmp_path_factory.mktemp("machine"))
    yield mine
    mine.shell.close()


def test_each_documented_command_has_a_test_or_a_reason() -> None:
    missing = [
        f"{command.place}: {command.command}" for command in shown() if row_of(command.command) is None
    ]
    assert missing == [], f"say in {TABLE.relative_to(ROOT)} how these commands are tested"


def test_each_row_is_of_a_command_that_a_page_shows() -> None:
    used = {row_of(command.command) for command in shown()}
    assert [row.command for row in rows() if row not in used] == [], f"remove them from {TABLE.name}"


@pytest.mark.parametrize(
    "row", [row for row in rows() if row.kind != "run"], ids=lambda row: row.command
)
def test_command_that_is_not_run_here_has_a_reason_or_a_test(row: Row) -> None:
    if row.kind == "not_run":
        assert len(row.text("why").split()) > 2
    else:
        file, _, name = row.text("test").partition("::")
        assert f"\ndef {name}(" in (ROOT / file).read_text()


@pytest.mark.long("documents")
@pytest.mark.parametrize(("row", "command"), runs(), ids=lambda value: getattr(value, "place", ""))
def test_documented_command_works_as_its_page_says(machine: Machine, row: Row, command: Shown) -> None:
    if name := runs_beside(command.command):
        machine.beside(name)
        assert machine.running is not None
        assert machine.running.count(row.text("until"))
        return
    machine.beside(row.text("beside"))
    if wanted := row.text("until"):
        machine.shell.interrupt(machine.shell.start(command.command, wanted))
        return

    def output() -> str:
        done = machine.shell.run(command.command)
        assert done.returncode == row.values.get("status", 0), done.stdout
        return done.stdout

    says = row.text("says")
    if says and row.text("beside"):  # a server that stood still for a moment says something else
        until(lambda: says in output(), f"it says {says}", every_s=0.5)
    else:
        assert says in output()


def test_commands_are_found_with_their_lines_and_without_comments() -> None:
    page = "text\n\n```sh\nmake run   # the demo\n# a comment\ncurl -s x \\\n  -d '#1'\n```\n\n"
    page += "   ```sh\n   ls\n   ```\n"
    assert list(commands_of(page)) == [(4, "make run"), (6, "curl -s x -d '#1'"), (11, "ls")]

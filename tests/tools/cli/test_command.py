"""`operator-panel`: its commands, and that `python -m app.…` are the same."""

import subprocess
import sys
from importlib.metadata import PackageNotFoundError
from pathlib import Path

import pytest

from app.tools.cli import command
from app.tools.cli.command import COMMANDS, main
from tests.support.parts import ROOT

OLD = {"check": "app.check", "log": "app.log", "simulate": "app.simulator"}


def helped(*words: str, capsys: pytest.CaptureFixture[str]) -> str:
    with pytest.raises(SystemExit) as ended:
        main([*words, "--help"])
    assert ended.value.code == 0
    said = capsys.readouterr()
    assert said.err == ""
    return said.out


def test_help_names_every_command(capsys: pytest.CaptureFixture[str]) -> None:
    said = helped(capsys=capsys)
    assert said.startswith("usage: operator-panel [-h] [--version] COMMAND")
    for name, row in COMMANDS.items():
        assert f"  {name:15}{row.about}\n" in said


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_help(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert helped(name, capsys=capsys).startswith(f"usage: operator-panel {name} [-h] ")


def test_a_command_of_a_command_has_help(capsys: pytest.CaptureFixture[str]) -> None:
    assert helped("log", "verify", capsys=capsys).startswith("usage: operator-panel log verify [-h] ")


@pytest.mark.parametrize("name", OLD)
def test_the_module_is_the_same_as_the_command(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    done = subprocess.run(
        [sys.executable, "-m", OLD[name], "--help"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    _, _, options = helped(name, capsys=capsys).partition("\n\n")
    assert done.stdout.startswith(f"usage: python -m {OLD[name]} ")
    assert done.stdout.endswith(options)


def test_no_command_is_help_and_an_error(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([]) == 2
    assert capsys.readouterr().err.startswith("usage: operator-panel ")


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["rnu"], '"rnu" is not a command: there is run, check, prove, edit, send, log, simulate'),
        (["cell1.toml"], "did you mean operator-panel run cell1.toml?"),
        (["--verison"], "--verison is not an option"),
        (["--"], "the command is missing: there is run, check, prove, edit, send, log, simulate"),
        (["log", "veryfy"], "argument COMMAND: invalid choice: 'veryfy'"),
        (["log"], "the following arguments are required: COMMAND"),
        (["check", "--verbos"], "--verbos is not an option of this command: did you mean --verbose?"),
        (["simulate", "a", "b", "c"], '"c" is one argument too many'),
    ],
)
def test_a_mistake_is_one_sentence(
    words: list[str], sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main(words)
    assert ended.value.code == 2
    said = capsys.readouterr().err
    assert said.startswith("operator-panel")
    assert sentence in said
    assert said.count("\n") == 1


@pytest.mark.parametrize("installed", [True, False])
def test_command_prints_its_version(
    installed: bool, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def version(name: str) -> str:
        if not installed:
            raise PackageNotFoundError
        return "1.2.3"

    monkeypatch.setattr(command, "version", version)
    with pytest.raises(SystemExit):
        main(["--version"])
    shown = "1.2.3" if installed else "(a checkout, not installed)"
    assert capsys.readouterr().out == f"operator-panel {shown}\n"


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_is_a_module_of_its_name(name: str) -> None:
    assert COMMANDS[name].module.rpartition(".")[2] == name.replace("-", "_")
    module = COMMANDS[name].load()
    assert module.make_parser("x").prog == "x"
    assert callable(module.main)


def after(*words: str, said: str) -> list[str]:
    """What an expression is in a new process after a command; its parts."""
    code = (
        f"import gc, sys; from app.tools.cli.command import main; main({list(words)});"
        f" print(); print({said})"
    )
    output = subprocess.check_output([sys.executable, "-c", code], cwd=ROOT, text=True)
    return output.splitlines()[-1].split()


def test_check_loads_no_server_and_excludes_imports_from_garbage_collection() -> None:
    said = "gc.isenabled(), gc.get_freeze_count() > len(gc.get_objects()), *sys.modules"
    collects, frozen, *modules = after("check", said=said)
    assert (collects, frozen) == ("True", "True")
    assert {"uvicorn", "fastapi", "zenoh"} & set(modules) == set()


def test_to_verify_a_log_takes_no_panel(tmp_path: Path) -> None:
    modules = after("log", "verify", f"--data={tmp_path}", said="*sys.modules")
    assert {"app.records.verify"} == {"app.records.verify", "app.panel", "pydantic"} & set(modules)

"""The completion that shells get: every command, its options, and the robot's topics."""

import shutil
import subprocess
from pathlib import Path

import pytest

from app.ros.messages import DISTROS
from app.tools.cli.command import COMMANDS, main
from app.tools.cli.completion import SHELLS


def script(shell: str, capsys: pytest.CaptureFixture[str]) -> str:
    assert main(["completion", shell]) == 0
    return capsys.readouterr().out


def completed(text: str, folder: Path, *words: str) -> set[str]:
    """What bash offers for the last of these words, with a robot of two topics."""
    fake = folder / "operator-panel"
    fake.write_text("#!/bin/sh\n[ $1 = topics ] && printf '/speed\\n/start\\n'\n")
    fake.chmod(0o755)
    line = " ".join(f"'{word}'" for word in ("operator-panel", *words))
    ask = f"COMP_WORDS=({line}); COMP_CWORD={len(words)}; _operator_panel; echo ${{COMPREPLY[@]}}"
    done = subprocess.run(
        [shutil.which("bash") or "bash", "-c", f"{text}\n{ask}"],
        env={"PATH": f"{folder}:/usr/bin:/bin"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stderr == ""
    return set(done.stdout.split())


def test_bash_completes_commands_options_values_and_topics(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = script("bash", capsys)
    assert completed(text, tmp_path, "") >= {*COMMANDS, "--version"}
    assert completed(text, tmp_path, "ec") == {"echo"}
    assert completed(text, tmp_path, "echo", "--f") == {"--field", "--full-length"}
    assert completed(text, tmp_path, "echo", "/sp") == {"/speed"}
    assert completed(text, tmp_path, "hz", "/s") == {"/speed", "/start"}
    assert completed(text, tmp_path, "echo", "--distro", "") == {*DISTROS}
    assert completed(text, tmp_path, "completion", "") >= {*SHELLS}
    assert completed(text, tmp_path, "run", "--mo") == {"--mode"}
    assert completed(text, tmp_path, "check", "/sp") == set()  # a file: bash completes those itself


def test_zsh_uses_that_of_bash(capsys: pytest.CaptureFixture[str]) -> None:
    first, rest = script("zsh", capsys).split("\n", 1)
    assert first == "autoload -U +X bashcompinit && bashcompinit"
    assert rest == script("bash", capsys)


def test_fish_has_every_command_with_its_options(capsys: pytest.CaptureFixture[str]) -> None:
    text = script("fish", capsys)
    for name in COMMANDS:
        assert f"complete -c operator-panel -n __fish_use_subcommand -f -a {name} -d " in text
        assert (
            f"complete -c operator-panel -n '__fish_seen_subcommand_from {name}' -s h -l help" in text
        )
    echo = [line for line in text.splitlines() if "_from echo'" in line]
    assert any("-l once -d " in line for line in echo)
    assert any("-l distro -r -f -a 'humble iron" in line for line in echo)
    assert any("(operator-panel topics --wait 1 2>/dev/null)" in line for line in echo)


def test_another_shell_is_told_which_there_are(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["completion", "tcsh"])
    assert "'bash', 'zsh', 'fish'" in capsys.readouterr().err

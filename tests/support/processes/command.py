"""The project's commands as separate processes. They are forked from a process with the imported
libraries, see `kiosk_parent`: importing takes longer than most commands."""

import os
import signal
import subprocess
import sys
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Final

from tests.support.processes.forked import ROOT, Forked, as_here

COMMAND: Final = "app.cli"  # `operator-panel`
ENDS_WITHIN_S: Final = 80.0  # on a busy machine

Started = Forked | subprocess.Popen[str]


def start(
    module: str, *words: str, folder: Path = ROOT, env: Mapping[str, str] | None = None
) -> Started:
    """`python -m MODULE WORDS` in `folder`, whose stdout and stderr are read. `env` is its whole
    environment; without one it is that of the tests."""
    if not as_here():
        return start_new(module, *words, folder=folder, env=env)
    return Forked.command(folder, [module, *words], os.environ if env is None else env)


def start_new(
    module: str, *words: str, folder: Path = ROOT, env: Mapping[str, str] | None = None
) -> Started:
    """The same as `start`, not forked."""
    return subprocess.Popen(
        [sys.executable, "-m", module, *words],
        cwd=folder,
        env={**(os.environ if env is None else env), "PYTHONPATH": str(ROOT)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        # Where the tests run in the background, it would ignore Ctrl-C as they do.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )


def run(
    module: str, *words: str, folder: Path = ROOT, env: Mapping[str, str] | None = None
) -> subprocess.CompletedProcess[str]:
    """The same as `start`; waits for its end."""
    return finished(start(module, *words, folder=folder, env=env))


def finished(process: Started) -> subprocess.CompletedProcess[str]:
    """Its exit status and what it has written that was not read before; TimeoutExpired if it does not
    end within ENDS_WITHIN_S."""
    assert process.stdout is not None
    assert process.stderr is not None
    with ThreadPoolExecutor(2) as pool, process.stdout, process.stderr:
        output, errors = pool.submit(process.stdout.read), pool.submit(process.stderr.read)
        try:
            status = process.wait(ENDS_WITHIN_S)
        except BaseException:
            process.kill()
            raise
        return subprocess.CompletedProcess(process.args, status, output.result(), errors.result())

"""Schemathesis on a server, in a process."""

import os
import subprocess
import sys
from pathlib import Path

from tests.support.places import ROOT


def fuzzed(description: str, folder: Path, *options: str) -> str:
    """What Schemathesis prints; an AssertionError with it unless it found nothing. `description` is the
    file or the address of an openapi.json."""
    done = subprocess.run(
        [str(Path(sys.executable).with_name("schemathesis")), "run", description, *options],
        cwd=folder,
        env={
            **os.environ,
            "PYTHONPATH": str(ROOT),
            "SCHEMATHESIS_HOOKS": "tests.support.media_types",
        },
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout

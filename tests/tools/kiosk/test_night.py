"""The screen that goes off: what turns it on again."""

import asyncio
import os
import signal
from datetime import time
from pathlib import Path

import pytest

from app.tools.kiosk import screen as night
from app.tools.kiosk.config import KioskConfig
from app.tools.kiosk.screen import Night
from tests.support.waiting import when

# Reports once, at its first start, that the time is up.
SWAYIDLE = """#!/bin/sh
echo $$ >>pids
[ -e once ] || { touch once; kill -USR1 $PPID; }
exec sleep 1000
"""


async def until_dark(screen: Night, dark: bool) -> None:
    await when(lambda: screen.dark is dark)


def test_a_watch_that_ends_while_the_screen_is_off_turns_it_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = tmp_path / "swayidle"
    program.write_text(SWAYIDLE)
    program.chmod(0o755)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    monkeypatch.setattr(night, "AWAKE_AFTER_S", 0.0)
    seen: list[tuple[str, bool]] = []

    async def power(on: bool) -> None:
        seen.append(("power", on))

    async def ignore_input(ignored: bool) -> None:
        seen.append(("ignored", ignored))

    async def run() -> None:
        screen = Night(KioskConfig(off_after_s=60), power, ignore_input)
        noon = time(12)
        try:
            await screen.update(noon, os.environ)
            await until_dark(screen, True)
            os.kill(int((tmp_path / "pids").read_text()), signal.SIGKILL)  # as with its compositor
            async with asyncio.timeout(20):
                while len((tmp_path / "pids").read_text().split()) < 2:
                    await screen.update(noon, os.environ)
                    await asyncio.sleep(0.01)
            await until_dark(screen, False)
        finally:
            await screen.end()

    asyncio.run(run())
    assert seen == [("ignored", True), ("power", False), ("power", True), ("ignored", False)]

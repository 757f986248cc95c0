"""The kiosk's screen: the Wayland compositor, and the screen that goes off when it is not touched."""

import asyncio
import json
import logging
import os
import signal
import subprocess
from collections.abc import Awaitable, Callable, Mapping
from contextlib import suppress
from datetime import time
from pathlib import Path
from typing import Final

from app.system.errors import SettingsError
from app.tools.kiosk.browser import Child
from app.tools.kiosk.config import KioskConfig

# The Wayland compositor: sway with a configuration of its own, in which no key does anything.
#
# Sway is in Debian and Ubuntu, rotates and turns off outputs, and maps touches to a rotated one.

STARTS_WITHIN_S: Final = 20.0
RESPONDS_WITHIN_S: Final = 5.0
POLL_S: Final = 0.05
DISPLAY_FILE: Final = "wayland-display"


def sway_config(config: KioskConfig, display_file: Path) -> str:
    """The compositor's configuration. There is no key binding in it, and Ctrl+Alt+F1 to F12 are plain
    function keys: no key leads out of the kiosk."""
    output = config.output or "*"
    lines = [
        "xwayland disable",
        "default_border none",
        "focus_on_window_activation focus",
        "input type:keyboard xkb_options srvrkeys:none",
        "seat * hide_cursor 3000",
        f"output {output} transform {config.rotate}" if config.rotate else "",
        f"output {output} mode {config.mode}" if config.mode else "",
        'for_window [app_id=".*"] fullscreen enable',
        f"exec 'printf %s \"$WAYLAND_DISPLAY\" >{display_file}'",
    ]
    return "\n".join(filter(None, lines)) + "\n"


class Compositor:
    """One run of the compositor. Without one, the browser is started in the session that there is."""

    def __init__(self, config: KioskConfig, folder: Path, env: Mapping[str, str]) -> None:
        self._config = config
        self._folder = folder
        self._env = dict(env)
        self._child: Child | None = None

    @property
    def runs(self) -> bool:
        return self._config.compositor == "none" or (self._child is not None and self._child.runs)

    @property
    def env(self) -> Mapping[str, str]:
        """The environment of what is shown in it."""
        return self._env

    @property
    def flags(self) -> tuple[str, ...]:
        """What the browser needs to know of it."""
        return () if self._config.compositor == "none" else ("--ozone-platform=wayland",)

    async def start(self) -> None:
        """SettingsError if the compositor can't be started or does not get ready."""
        if self._config.compositor == "none":
            return
        display, socket = self._folder / DISPLAY_FILE, self._folder / "sway.sock"
        for stale in (display, socket):
            stale.unlink(missing_ok=True)
        file = self._folder / "sway.conf"
        file.write_text(sway_config(self._config, display))
        self._env |= {"SWAYSOCK": str(socket), "XDG_RUNTIME_DIR": str(self._folder)}
        self._env.pop("WAYLAND_DISPLAY", None)
        try:
            self._child = Child(["sway", "--config", str(file)], self._env)
        except OSError as error:
            raise SettingsError(f"the compositor can't be started: {error}") from error
        with suppress(TimeoutError):
            async with asyncio.timeout(STARTS_WITHIN_S):
                while self._child.runs and not (display.exists() and display.read_text()):
                    await asyncio.sleep(POLL_S)
                if self._child.runs:
                    self._env["WAYLAND_DISPLAY"] = display.read_text()
                    await self._map_touches()
                    return
        await self.end()
        raise SettingsError("the compositor did not start: its reason is in the lines before this one")

    async def power(self, on: bool) -> None:
        """Turns the outputs on or off."""
        state = "on" if on else "off"
        # "power" has replaced "dpms"; sway 1.7 has the latter alone, later ones have both.
        await self._send("output", "*", "dpms", state)

    async def end(self) -> None:
        if self._child is not None:
            await self._child.end(grace_s=2.0)

    async def _map_touches(self) -> None:
        """A touch is where it is seen: on a rotated output too."""
        output = self._config.output or await asyncio.to_thread(self._first_output)
        if output:
            await self._send("input", "type:touch", "map_to_output", output)

    def _first_output(self) -> str:
        query = ["swaymsg", "--raw", "--type", "get_outputs"]
        with suppress(OSError, ValueError, subprocess.SubprocessError, LookupError):
            result = subprocess.run(
                query, env=self._env, capture_output=True, timeout=RESPONDS_WITHIN_S, check=True
            )
            return str(json.loads(result.stdout)[0]["name"])
        return ""

    async def _send(self, *command: str) -> None:
        if self._config.compositor == "none" or not self.runs:
            return
        with suppress(OSError, TimeoutError):
            message = Child(["swaymsg", "--quiet", *command], self._env)
            try:
                async with asyncio.timeout(RESPONDS_WITHIN_S):
                    await message.ended.wait()
            finally:
                await message.end()


# The screen goes off when it is not touched for long. The touch that wakes it presses nothing.
#
# swayidle reports idleness by signals: SIGUSR1 when the time is up, SIGUSR2 at the next touch.

log = logging.getLogger("kiosk.screen")

# Between the touch that wakes the screen and the first that counts.
AWAKE_AFTER_S: Final = 1.0


def may_be_off(between: tuple[str, ...], now: time) -> bool:
    """Whether `now` is in the time of the day in which the screen may go off, which may be over
    midnight. Without times it always is."""
    if not between:
        return True
    start, end = (time.fromisoformat(text) for text in between)
    return start <= now < end if start <= end else now >= start or now < end


class Night:
    """`dark` is whether the screen is off. `power` turns it on or off, `ignore_input` says whether
    touches reach the page."""

    def __init__(
        self,
        config: KioskConfig,
        power: Callable[[bool], Awaitable[None]],
        ignore_input: Callable[[bool], Awaitable[None]],
    ) -> None:
        self._config = config
        self._power = power
        self._ignore_input = ignore_input
        self._idle: Child | None = None
        self._turning: asyncio.Task[None] | None = None
        self._wanted = self.dark = False

    async def update(self, now: time, env: Mapping[str, str]) -> None:
        """Starts or ends the watch for idleness. Called again and again."""
        config = self._config
        wanted = config.off_after_s > 0 and may_be_off(config.off_between, now)
        runs = self._idle is not None and self._idle.runs
        if wanted and not runs:
            self._listen(env)
        elif not wanted and self._idle is not None:
            await self._idle.end()
            self._idle = None
            self._turn(False)

    async def end(self) -> None:
        if self._idle is not None:
            await self._idle.end()
        if self._turning is not None:
            self._turning.cancel()

    def _listen(self, env: Mapping[str, str]) -> None:
        self._turn(False)  # a new watch does not know of a screen that went off before it
        loop = asyncio.get_running_loop()
        loop.add_signal_handler(signal.SIGUSR1, self._turn, True)
        loop.add_signal_handler(signal.SIGUSR2, self._turn, False)
        kill = "kill -{} " + str(os.getpid())
        command = ["swayidle", "-C", "/dev/null", "timeout", str(self._config.off_after_s)]
        with suppress(OSError):
            self._idle = Child([*command, kill.format("USR1"), "resume", kill.format("USR2")], env)

    def _turn(self, dark: bool) -> None:
        self._wanted = dark
        if self._turning is None or self._turning.done():
            self._turning = asyncio.ensure_future(self._follow())

    async def _follow(self) -> None:
        while self.dark != self._wanted:
            dark = self._wanted
            log.info("the screen %s", "goes off" if dark else "goes on")
            if dark:
                self.dark = True  # first no touch counts, then the screen is off
                await self._ignore_input(True)
                await self._power(False)
            else:
                await self._power(True)
                await asyncio.sleep(AWAKE_AFTER_S)
                await self._ignore_input(False)
                self.dark = False
                log.info("touches count again")

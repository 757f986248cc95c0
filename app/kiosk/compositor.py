"""The Wayland compositor: sway with a configuration of its own, in which no key does anything.

Sway is in Debian and Ubuntu, rotates and turns off outputs, and maps touches to a rotated one.
"""

import asyncio
import json
import subprocess
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Final

from app.errors import SettingsError
from app.kiosk.child import Child
from app.kiosk.config import KioskConfig

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

"""The panel file is sent to a kiosk: compared first, then sent, and followed until the kiosk shows it.

The address and the token are kept in the memory of this process only.
"""

import asyncio
import logging
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any, Final, Literal

from pydantic import BaseModel

from app.system.clock import format_time
from app.system.concurrency import spawn_logged
from app.system.texts import TextLike, say
from app.system.version import installed_version
from app.tools.editor.kiosk_client import KioskClient, KioskRefused, new_act_id, packed

log = logging.getLogger("kiosk.editor")

FOLLOWED_S: Final = 90.0
LOOK_S: Final = 0.5

# `compared`: the person who edits decides. `sending`, `starting` and `unknown` wait for the kiosk; the
# others are ends.
Stage = Literal["", "compared", "sending", "starting", "shown", "restored", "refused", "unknown"]
WAITING: Final = frozenset[Stage]({"sending", "starting"})


class Destination(BaseModel):
    """Where to send; "" for the token takes the one before."""

    address: str
    token: str = ""
    trust: str = ""


@dataclass(slots=True)
class Sending:
    """What one person sends. Used on the event loop only."""

    path: Path
    changed: Callable[[], None]
    address: str = ""
    trust: str = ""
    stage: Stage = ""
    kiosk: Mapping[str, Any] = field(default_factory=dict)
    check: Mapping[str, Any] = field(default_factory=dict)
    problem: TextLike = ""
    result: TextLike = ""
    is_busy: bool = False
    _token: str = ""
    _act_id: str = ""
    _client: KioskClient | None = None
    _following: "asyncio.Task[None] | None" = None

    @property
    def has_token(self) -> bool:
        return bool(self._token)

    @property
    def can_send(self) -> bool:
        """Whether what was compared can be sent now."""
        check = self.check
        is_good = bool(check) and not check["faults"] and not check["refusal"]
        return self.stage == "compared" and is_good and check["sent"] != check["compared"]

    @property
    def other_version(self) -> str:
        """The version of the kiosk, if it is another one than that of this editor."""
        version = str(self.kiosk.get("version", ""))
        return "" if version == installed_version() else version

    async def compare(self, to: Destination, language: str) -> None:
        """Asks the kiosk what it says of the file on the disk, and how that differs from its own."""
        if self.is_busy or self.stage in WAITING:
            return
        self.address, self.trust = to.address.strip()[:300], to.trust.strip()[:1000]
        self._token = to.token.strip() or self._token
        self.stage, self.problem, self.result = "", "", ""
        self.kiosk, self.check = {}, {}
        with self._working():
            try:
                client = KioskClient(self.address, self._token, self.trust, language)
                archive = await asyncio.to_thread(packed, self.path)
                self.kiosk = await asyncio.to_thread(client.panel)
                self.check = await asyncio.to_thread(client.check, archive)
            except KioskRefused as error:
                self.problem = error.text
            else:
                self.stage, self._client, self._act_id = "compared", client, new_act_id()

    async def send(self) -> None:
        """Sends what was compared; pressed again, it sends nothing more."""
        client = self._client
        if not self.can_send or client is None or self.is_busy:
            return
        self.stage = "sending"
        with self._working():
            try:
                receipt = await asyncio.to_thread(
                    client.take, self.check["sent"], self.check["compared"], self._act_id
                )
            except KioskRefused as error:
                if not error.is_lost:
                    self.stage, self.problem = "refused", error.text
                    return
                self.problem = error.text  # the kiosk itself says whether it has taken it
            else:
                self.problem = ""
                self.result = receipt["reason"]
                if receipt["outcome"] == "refused":
                    self.stage = "refused"
                    return
        self.stage = "starting"
        self.changed()
        self._following = spawn_logged(self._follow(client), log, "following a kiosk failed")

    async def _follow(self, client: KioskClient) -> None:
        """Waits until the kiosk shows what was sent, or says why it does not."""
        until = time.monotonic() + FOLLOWED_S
        while time.monotonic() < until:
            try:
                state = await asyncio.to_thread(client.panel)
            except KioskRefused as error:
                if not error.is_lost:
                    self.problem = error.text
            else:
                last = state.get("last") or {}
                if last.get("new") == self.check["sent"] and last.get("phase") in ("kept", "restored"):
                    await self._end(client, last)
                    return
                if last.get("new") != self.check["sent"] and self.problem:
                    self._ends("refused", self.problem)  # it was lost before the kiosk had it
                    return
            await asyncio.sleep(LOOK_S)
        self._ends("unknown", say("send_unknown", seconds=str(round(FOLLOWED_S))))

    async def _end(self, client: KioskClient, last: Mapping[str, Any]) -> None:
        self.problem = ""
        if last["phase"] == "restored":
            self._ends("restored", str(last["text"]))
            return
        at = format_time(datetime.fromisoformat(last["since"]).timestamp())
        try:
            waits = await asyncio.to_thread(client.readiness)
        except KioskRefused as error:
            waits = str(error)
        text = say("send_shown_waits", time=at, why=waits) if waits else say("send_shown", time=at)
        self._ends("shown", text)

    def _ends(self, stage: Stage, text: TextLike) -> None:
        self.stage, self.result = stage, text
        self.changed()

    async def finished(self) -> None:
        """Waits until the kiosk shows what was sent, or does not."""
        if self._following is not None:
            await self._following

    def close(self) -> None:
        if self._following is not None:
            self._following.cancel()

    def _working(self) -> "_Working":
        return _Working(self)


class _Working:
    """Within it, a request is under way."""

    def __init__(self, sending: Sending) -> None:
        self._sending = sending

    def __enter__(self) -> None:
        self._sending.is_busy = True
        self._sending.changed()

    def __exit__(self, *_: object) -> None:
        self._sending.is_busy = False
        self._sending.changed()

"""Panel files that engineers send to this server: their check, their take, and how the last one ended.

Reading and checking is the work of a child process, so that no press waits for it.
"""

import asyncio
import logging
import os
import secrets
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from app.cell.commands.acts import ActContext, ActRequest, ActRunner
from app.cell.commands.panel_acts import PANEL_ACTS, PanelTaker
from app.cell.permission.control import same_client
from app.cell.session.fleet import Fleet
from app.records import NullLog, OperatorLog
from app.records.entry import Origin, new_entry
from app.records.press_record import PressLog, origin_of
from app.records.principal import Principal
from app.records.sent_panel import SentPanelError, SentPanels, Take, short
from app.system.concurrency import InFlight
from app.system.errors import LogError, TooMany
from app.system.texts import Text, TextLike, say, text_in
from app.system.worker import Limits, Worker, WorkerError

log = logging.getLogger("kiosk.panel")

LIMITS: Final = Limits(within_s=60.0)
TRIAL_S: Final = 5.0  # the server has run for so long with a sent panel: it stays
RESTART_AFTER_S: Final = 0.3  # the receipt is on its way
BUSY_S: Final = 2
WORK: Final = "app.records.sent_panel:answered"


class PanelReceiver(PanelTaker):
    """Takes panel files for one server. Used on the event loop only."""

    def __init__(
        self,
        panel: Path,
        fleet: Fleet,
        oplog: OperatorLog | NullLog,
        restart: Callable[[], None],
        *,
        is_dev: bool = False,
    ) -> None:
        """`restart` ends the server in an orderly way and starts it again."""
        self.disk = SentPanels(panel)
        self._panel = panel
        self._fleet = fleet
        self._log = oplog
        self._restart = restart
        self._is_dev = is_dev
        self._busy = False
        self._is_due = False
        context = ActContext(fleet.first.press_guard, PressLog(oplog), "", lambda: None)
        self.acts: ActRunner[PanelTaker] = ActRunner("panel", PANEL_ACTS, self, context)

    @property
    def last(self) -> Take | None:
        """The last take. Blocks for a moment."""
        return self.disk.last()

    async def read(self) -> dict[str, Any]:
        """The panel file in force, as `app.records.sent_panel` reads it; SentPanelError."""
        return await self._work("read", str(self._panel))

    async def check(self, archive: bytes) -> dict[str, Any]:
        """What `check` says of a zip file with a panel and its files; SentPanelError, TooMany while
        another one is checked."""
        if (refusal := await asyncio.to_thread(self.disk.refusal)) is not None:
            raise SentPanelError(refusal)
        if self._busy:
            raise TooMany(say("panel_check_busy"), BUSY_S)
        self._busy = True
        path = self.disk.folder / f"incoming-{secrets.token_hex(8)}.zip"
        try:
            await asyncio.to_thread(_write, path, archive)
            return await self._work("check", str(self._panel), str(path))
        except OSError as error:
            raise SentPanelError(say("panel_sent_not_written", why=str(error))) from error
        finally:
            self._busy = False
            path.unlink(missing_ok=True)

    def obstacle(self, who: Principal) -> Text | None:
        if self._is_dev:
            return say("panel_take_dev")
        for session in self._fleet.sessions:
            name: TextLike = session.robot.name or say("robot")
            if session.holds.has_active or session.commands.actions.has_running:
                return say("panel_take_moves", robot=name)
            holder = session.control.holder
            is_own = holder is not None and (
                same_client(who, holder) or (bool(who.user) and who.user == holder.user)
            )
            if holder is not None and not is_own:
                return say("panel_take_controlled", robot=name, name=holder.name)
        return self.disk.refusal()

    def lock(self) -> None:
        for session in self._fleet.sessions:
            session.press_guard.close("panel_being_taken")

    async def take(self, request: ActRequest) -> Text | None:
        origin, values = origin_of(request.who), request.values
        about = {"who": origin.who, "address": origin.address, "browser": origin.browser}
        try:
            if not await asyncio.to_thread(self.disk.is_staged, values["sent"]):
                raise SentPanelError(say("panel_sent_gone"))
            taken = await self._work(
                "take", str(self._panel), values["sent"], values["compared"], about
            )
        except SentPanelError as error:
            self._unlock()
            return error.text if isinstance(error.text, Text) else say("panel_sent_gone")
        if taken["is_new"]:
            self._is_due = True
        else:
            self._unlock()
        return None

    def restart_if_due(self) -> None:
        """Starts the server again after a take, once."""
        if self._is_due:
            self._is_due = False
            asyncio.get_running_loop().call_later(RESTART_AFTER_S, self._restart)

    async def follow_trial(self, in_flight: InFlight) -> None:
        """After a start: the result of the last take goes to the log; a panel with which the server
        runs for `TRIAL_S` stays."""
        take = await asyncio.to_thread(self.disk.last)
        if take is not None and take.phase == "trial":
            await asyncio.sleep(TRIAL_S)
            with in_flight.track():
                await asyncio.to_thread(self.disk.came_up)
            take = await asyncio.to_thread(self.disk.last)
        if take is not None and not take.logged and take.phase in ("kept", "restored"):
            self._log_end(take)
            await asyncio.to_thread(self.disk.mark_logged)

    def _log_end(self, take: Take) -> None:
        is_kept = take.phase == "kept"
        origin = Origin(address=take.address, browser=take.browser, who=take.who)
        text = outcome_text(take)
        (log.info if is_kept else log.error)("%s", text)
        outcome = "succeeded" if is_kept else "aborted"
        values = {"sent": take.new, "compared": take.old, "backup": take.backup}
        try:
            self._log.add(
                new_entry("panel", origin, values, text, action=f"panel_{take.phase}", outcome=outcome)
            )
        except LogError as error:
            log.warning("the result of a sent panel is not in the operator's log: %s", error)

    def _unlock(self) -> None:
        for session in self._fleet.sessions:
            session.press_guard.reopen()

    async def _work(self, name: str, *arguments: object) -> dict[str, Any]:
        def call() -> dict[str, Any]:
            results = Worker(WORK, name, *arguments, limits=LIMITS).results()
            answer: dict[str, Any] = next(iter([*results]), {})
            return answer

        try:
            answer = await asyncio.to_thread(call)
        except (WorkerError, OSError) as error:
            raise SentPanelError(say("panel_check_failed", why=str(error))) from error
        if refusal := answer.get("refusal"):
            raise SentPanelError(text_in(refusal))
        return answer


def outcome_text(take: Take) -> TextLike:
    """The result of a take, as a sentence."""
    old, new, name = short(take.old), short(take.new), take.who
    if take.phase == "kept":
        return say("panel_kept", old=old, new=new, name=name)
    if take.phase == "restored":
        return say("panel_restored", old=old, new=new, name=name, why=take.reason_text)
    return say("panel_trial", old=old, new=new, name=name)


def _write(path: Path, data: bytes) -> None:
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    fd = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600)
    with open(fd, "wb") as file:
        file.write(data)

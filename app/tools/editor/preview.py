"""The preview: pages of the panel that is edited, by the application that serves a kiosk.

There are two states of it. `live` is a panel with sessions of its robots, simulated or real; what an
open page shows and presses comes from it. `drawn` is the newest panel with what the live sessions have
received: a page is drawn from it at once after an edit, and the sessions follow in the background.
"""

import asyncio
import logging
import shutil
from collections.abc import Callable, Mapping
from contextlib import AsyncExitStack, ExitStack, suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Final

from starlette.datastructures import MutableHeaders, QueryParams
from starlette.responses import JSONResponse
from starlette.types import Message, Receive, Scope, Send

from app.cell.commands.judge import PressLimits
from app.cell.people.access import Access
from app.cell.people.users_file import UsersFile
from app.cell.session.doctor_process import DoctorProcess
from app.cell.session.fleet import Fleet
from app.panel import Panel
from app.panel.checks.look import page_parts
from app.panel.model import RobotEntry
from app.panel.rules import AccessRules, EmbedRules
from app.panel.widgets.kinds import KINDS
from app.records import NullLog
from app.ros.zenoh.config import Config, config_from, config_to
from app.ros.zenoh.session import Unconnected, ZenohSession
from app.system.concurrency import keep_running
from app.system.settings import Settings, shipped_path
from app.system.texts import render, say
from app.system.used_certificates import UsedCertificates
from app.tools.editor.temporary_folder import TemporaryFolder
from app.tools.robot.link import Place
from app.tools.simulator.in_process import in_process
from app.web.app_state import AppState
from app.web.application import load_pages, new_application, page_assets, page_revision
from app.web.asgi import Application
from app.web.assets import Assets
from app.web.metrics import Metrics
from app.web.pages.compiled_templates import COMPILED
from app.web.pages.page_templates import PageTemplates
from app.web.security import POLICY, STARTS, content_security_policy, moves, refuse

log = logging.getLogger("kiosk.editor")

ROOT: Final = "/preview"
DRAWN: Final = "drawn"  # in the query of a page: of the newest panel, before its sessions run
SETTLED_S: Final = 0.3  # without an edit, before the sessions of a panel are started
JOINED_WITHIN_S: Final = 5.0
POLL_S: Final = 0.05
# Sessions of the panel before end this long after: pages that are open take the new ones by then.
ENDED_AFTER_S: Final = 3.0
# Keys that no simulated robot depends on.
ONLY_SHOWN: Final = frozenset(
    {
        *("label", "title", "note", "icon", "span", "rows", "columns", "grow", "help", "show_label"),
        *("confirm", "texts", "brand", "language", "languages", "size", "style", "header", "fit"),
        *("template", "styles", "needs", "format", "unit", "text", "on", "off", "page", "group"),
        *("id", "role", "show_label", "key_colour"),
    }
)

Tables = Mapping[str, Any]


@dataclass(eq=False)
class LivePanel:
    """A panel with its running sessions; `number` is that of its preview."""

    number: int
    state: AppState
    closing: AsyncExitStack


class Preview:
    """Opened by `start`, closed by `stop`. Used on the event loop only."""

    def __init__(self, path: Path, settings: Settings, is_live: bool = False) -> None:
        """`is_live`: the robots are those of `settings.zenoh`, which are only read."""
        self.is_live = is_live
        self.number = 0  # of the newest panel, from 1
        self.on_live: Callable[[], None] = lambda: None
        self._path = path
        self._folder = TemporaryFolder()
        self._settings = replace(
            settings,
            panel=path,
            mode="live" if is_live else "demo",
            data=self._folder.path,
            root_path=ROOT,
            dev=False,
        )
        self._pages, self._drawing = self._application(), self._application()
        self._newest: Panel | None = None
        self._live: LivePanel | None = None
        self._ended: list[asyncio.Task[None]] = []
        self._edited = asyncio.Event()
        self._turn = asyncio.Lock()
        self._templates = PageTemplates(shipped_path("templates"), {}, shipped_path(COMPILED))
        self._assets: tuple[object, Assets] | None = None
        self._log = NullLog()
        self._limits = PressLimits(partial(self._log.suppress, limited=True))
        self._doctor = DoctorProcess(self._settings)
        self._access = Access(UsersFile(self._settings.data_folder("demo")), AccessRules(), self._log)
        self._needs: object = None
        self._robots: _Robots | None = None
        self._following: asyncio.Task[None] | None = None

    def _application(self) -> Application:
        return new_application(self._settings, EmbedRules())

    async def start(self) -> None:
        self._folder.create()
        await self._access.reload()
        self._following = keep_running(self._follow, log, "the preview's sessions failed")

    async def stop(self) -> None:
        if self._following is not None:
            self._following.cancel()
            await asyncio.gather(self._following, return_exceptions=True)
        if self._live is not None:
            self._live.state.fleet.close()
            self._end(self._live, 0.0)
        await asyncio.gather(*self._ended, return_exceptions=True)
        await self._doctor.stop()
        self._access.close()
        self._folder.remove()

    @property
    def panel(self) -> Panel | None:
        """The newest panel; None while there was none without faults."""
        return self._newest

    @property
    def live_number(self) -> int:
        """The number of the panel whose sessions run."""
        return self._live.number if self._live else 0

    def show(self, panel: Panel, tables: Tables) -> None:
        """Draws this panel from now on; its sessions follow."""
        # Whoever edits sees all pages, in a frame of the editor's own page, and signs in nowhere.
        # The languages are those that it has now: no copy looks for its texts again.
        rules = {
            "access": AccessRules(),
            "embed": EmbedRules(),
            "languages": panel.readers_languages,
        }
        self._newest = panel.model_copy(update=rules)
        self._templates.use(page_parts(self._newest))
        self.number += 1
        self._needs = _needs(tables)
        self._edited.set()

    async def robot_place(self) -> Place | None:
        """Where the robot is of which the list is read, of several the first; None while there is
        none."""
        panel = self._newest
        if panel is None:
            return None
        first = panel.robots[0] if panel.robots else None
        reached = first or panel
        place = Place(
            zenoh=self._settings.zenoh,
            connect=first.connect if first else (),
            namespace=reached.namespace,
            distro=panel.distro,
            interfaces=panel.interfaces,
            dialect=reached.dialect,
            domain=reached.domain,
        )
        if self.is_live:
            return place
        endpoint = self._robots and self._robots.endpoints.get(first.id if first else None)
        shipped = shipped_path("zenoh.json5")
        return replace(place, zenoh=shipped, connect=(endpoint,)) if endpoint else None

    # Requests.

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if self._newest is None:
            await refuse(JSONResponse({"error": "no panel"}, 503), scope, receive, send)
            return
        if self.is_live and scope["type"] in ("http", "websocket") and moves(scope):
            await refuse(JSONResponse(self._refusal(scope), 409), scope, receive, send)
            return
        # What the editor's own layers keep in it is none of the panel's.
        scope = {key: value for key, value in scope.items() if not key.startswith("panel.")}
        framed = _framed(send)
        query = QueryParams(scope.get("query_string", b""))
        if DRAWN in query or self._live is None:
            async with self._turn:
                self._drawing.state.app_state = self._drawn(scope["path"])
                await self._drawing(scope, receive, framed)
            return
        await self._pages(scope, receive, framed)

    def _refusal(self, scope: Scope) -> dict[str, str]:
        language = self._newest.language if self._newest else "en"
        return {"error": render(say("editor_live_only_shows"), language)}

    # What is drawn.

    def _drawn(self, path: str) -> AppState:
        """The state for one page of the newest panel: only its widgets are built."""
        assert self._newest is not None
        page = path.partition("/pages/")[2] or self._newest.pages[0].id
        try:
            fleet = self._unconnected(_only(self._newest, page))
        except (KeyError, LookupError, ValueError):  # the page needs widgets of others
            fleet = self._unconnected(self._newest)
        fleet.panel = self._newest
        return self._state(fleet, self._newest)

    def _unconnected(self, panel: Panel) -> Fleet:
        fleet = self._fleet(panel, lambda _: config_to("tcp/127.0.0.1:0"), Unconnected)
        fleet.show_as(self._live.state.fleet if self._live is not None else None)
        return fleet

    def _fleet(
        self,
        panel: Panel,
        config_of: Callable[[RobotEntry | None], Config],
        link: type[ZenohSession] = ZenohSession,
    ) -> Fleet:
        return Fleet(
            panel,
            config_of,
            page_revision(panel, self._assets_of(panel)),
            self._log,
            simulated=not self.is_live,
            root_path=ROOT,
            doctor=self._doctor,
            link=link,
        )

    def _assets_of(self, panel: Panel) -> Assets:
        """Made again only where a file of the panel or what its style depends on is another one."""
        files = (panel.shown_pictures, panel.styles, panel.templates, panel.brand, panel.fonts)
        key = (repr(files), panel.mm_per_px, panel.may_raise)
        if self._assets is None or self._assets[0] != key:
            self._assets = key, page_assets(panel, KINDS)
        return self._assets[1]

    def _state(self, fleet: Fleet, panel: Panel) -> AppState:
        metrics = Metrics(fleet, lambda: 0, lambda: self._limits.refused, lambda: {})
        return AppState(
            fleet,
            self._assets_of(panel),
            self._templates,
            metrics,
            self._log,
            self._limits,
            self._doctor,
            self._access,
        )

    # The sessions.

    async def _follow(self) -> None:
        """Starts the sessions of the newest panel when nothing was edited for a moment, for ever."""
        while True:
            await self._edited.wait()
            while self._edited.is_set():
                self._edited.clear()
                if self._live is not None:
                    await asyncio.sleep(SETTLED_S)
            await self._run_newest()

    async def _run_newest(self) -> None:
        panel, number = self._newest, self.number
        if panel is None:
            return
        closing = AsyncExitStack()
        try:
            live = await self._started(panel, number, closing)
        except BaseException:
            await closing.aclose()
            raise
        before, self._live = self._live, live
        self._pages.state.app_state = live.state
        if before is not None:
            self._end(before, ENDED_AFTER_S)
        self.on_live()
        if before is None:
            await load_pages(self._pages, live.state, panel)

    async def _started(self, panel: Panel, number: int, closing: AsyncExitStack) -> LivePanel:
        """The panel with its sessions, which have reached its robots, or tried for some seconds."""
        config_of: Callable[[RobotEntry | None], Config]
        if self.is_live:
            zenoh = self._settings.zenoh

            def config_of(entry: RobotEntry | None) -> Config:
                return config_from(zenoh, entry.connect if entry else ())
        else:
            robots = await self._connected(panel)
            closing.push_async_callback(robots.release)

            def config_of(entry: RobotEntry | None) -> Config:
                return config_to(robots.endpoints[entry.id if entry else None])

        fleet = self._fleet(panel, config_of)
        folder = self._settings.data_folder("demo")
        own = folder / f"panel-{number}"
        own.mkdir()
        closing.callback(shutil.rmtree, own, ignore_errors=True)
        closing.push_async_callback(fleet.stop)
        await fleet.alarms.start(own, self._log, UsedCertificates([], None))
        closing.push_async_callback(fleet.alarms.stop)
        await fleet.recipes.start(folder, self._log)
        closing.push_async_callback(fleet.recipes.stop)
        if fleet.place_file is not None:
            await fleet.place_file.start(folder)
            closing.push_async_callback(fleet.place_file.stop)
        await fleet.start()
        if self._live is not None:
            with suppress(TimeoutError):
                async with asyncio.timeout(JOINED_WITHIN_S):
                    while not fleet.has_joined(self._live.state.fleet):
                        await asyncio.sleep(POLL_S)
        return LivePanel(number, self._state(fleet, panel), closing)

    async def _connected(self, panel: Panel) -> "_Robots":
        """Simulated robots for a panel, which is counted."""
        robots, needs = self._robots, self._needs
        if robots is not None and robots.panels and robots.needs == needs:
            robots.panels += 1
        else:
            robots = self._robots = await asyncio.to_thread(_Robots, needs, panel)
        return robots

    def _end(self, live: LivePanel, after_s: float) -> None:
        async def end() -> None:
            await asyncio.sleep(after_s)
            live.state.fleet.close()
            await live.closing.aclose()

        self._ended = [task for task in self._ended if not task.done()]
        self._ended.append(asyncio.get_running_loop().create_task(end()))


class _Robots:
    """Simulated robots, which go on from panel to panel while these need the same."""

    def __init__(self, needs: object, panel: Panel) -> None:
        """Blocks while they are started."""
        self.needs = needs
        self.panels = 1  # that are connected to them
        self._stack = ExitStack()
        with ExitStack() as stack:
            self.endpoints: Mapping[str | None, str] = {
                entry.id if entry else None: stack.enter_context(in_process(panel, entry))
                for entry in panel.robots or (None,)
            }
            self._stack = stack.pop_all()

    async def release(self) -> None:
        """A panel is not connected any more; without any they end."""
        self.panels -= 1
        if not self.panels:
            await asyncio.to_thread(self._stack.close)


def _needs(tables: Tables) -> object:
    """What the simulated robots of a panel file depend on: the tables, in any order, without what is
    only shown."""
    lines: set[str] = set()

    def gather(table: Any, name: str) -> None:
        if isinstance(table, Mapping):
            own = {
                key: value for key, value in table.items() if key not in ONLY_SHOWN and key != "widget"
            }
            lines.add(f"{name} {own!r}")
            for key in ("page", "group", "widget"):
                for inner in _tables_in(table.get(key)):
                    gather(inner, key)

    gather(tables, "")
    return lines


def _tables_in(value: Any) -> list[Any]:
    return value if isinstance(value, list) else []


def _only(panel: Panel, page_id: str) -> Panel:
    """The panel with the widgets of one page only."""
    if panel.recipes or panel.copies:  # these name widgets of other pages
        return panel
    pages = tuple(
        page if page.id == page_id else page.model_copy(update={"own": (), "groups": ()})
        for page in panel.pages
    )
    return panel.model_copy(update={"pages": pages})


def _framed(send: Send) -> Send:
    """`send` with a policy that lets the editor's own page show the document in a frame."""

    async def send_framed(message: Message) -> None:
        if message["type"] in STARTS:
            headers = MutableHeaders(scope=message)
            policy = headers.get(POLICY) or content_security_policy()
            headers[POLICY] = policy.replace("frame-ancestors 'none'", "frame-ancestors 'self'")
        await send(message)

    return send_framed

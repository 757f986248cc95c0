"""The panel of the proof: the kiosk's own application with its robot simulated, served on loopback, and
a client of it. Everything is in this process, in threads: nothing of it reaches a real robot."""

import asyncio
import http.client
import json
import logging
import secrets
import socket
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AsyncExitStack, ExitStack, contextmanager, suppress
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, Final
from urllib.parse import quote, urlencode

import uvicorn
from fastapi import FastAPI

from app.cell.commands.judge import PressLimits
from app.cell.people.access import Access
from app.cell.people.secrets_hash import Cost, hashed
from app.cell.people.users import User, UserBook
from app.cell.people.users_file import UsersFile
from app.cell.session.assembly import open_fleet, open_log
from app.cell.session.doctor_process import DoctorProcess
from app.panel import Panel
from app.panel.condition import Interlock
from app.panel.model import RobotEntry
from app.panel.roles import ENGINEER
from app.panel.widgets.key_parts import Confirmation
from app.panel.widgets.parameter import GET
from app.ros.messages import load_interfaces
from app.system.errors import KioskError
from app.system.settings import Settings
from app.tools.prove.cases import Persona, Situation
from app.tools.prove.robot import ProvingRobots
from app.tools.prove.shown import Shown, read_events
from app.tools.simulator.zenoh import ANY_PORT, Simulator, way_of
from app.web.app_state import AppState
from app.web.application import (
    load_pages,
    new_application,
    open_state,
    page_assets,
    page_revision,
)
from app.web.requests import FORM
from app.web.server import OPTIONS

log = logging.getLogger("kiosk.prove")

STARTED_WITHIN_S: Final = 30.0
ANSWER_WITHIN_S: Final = 10.0
POLL_S: Final = 0.01
SETTLED_WITHIN_S: Final = 0.5  # from a refusal until the page shows its reason
REQUESTED: Final = ("alarms", "session")  # first segments of paths, beside what pages use
LOADING: Final = threading.Lock()  # Pydantic builds the schema of a model in one thread at a time
KEPT_EVERY_S: Final = 1.0
QUICK: Final = Cost(8, 1)  # of PINs that no one has to know
HOLDER: Final = Persona(ENGINEER)  # the rig's own client, where the panel has users
SECOND: Final = Persona(ENGINEER, frozenset({"second"}))  # confirms what takes two persons
PACE_S: Final = 0.022  # between two presses: a client may press 50 times in a second


@dataclass
class Rig:
    """A running panel with its proving robot. Used by the thread of one round of the proof."""

    panel: Panel
    robots: ProvingRobots
    data: Path
    shown: Shown = field(default_factory=Shown)
    port: int = 0  # any that is free
    _simulators: dict[str, Simulator] = field(default_factory=dict)
    _made: dict[str, Callable[[], Simulator]] = field(default_factory=dict)  # at the same endpoint
    _simulating: dict[str, ExitStack] = field(default_factory=dict)
    _state: AppState | None = None
    _loop: asyncio.AbstractEventLoop | None = None
    _server: uvicorn.Server | None = None
    _threads: list[threading.Thread] = field(default_factory=list)
    _ends: threading.Event = field(default_factory=threading.Event)
    _fault: BaseException | None = None
    _pressed_at: float = 0.0
    cookie: str = ""
    users: Sequence[Persona] = ()  # with any, the rig's own client is signed in as an engineer
    _client: str = ""  # the cookie of the rig's own client without a session
    _held: str = ""  # the same with its session, also while `cookie` is a stranger's
    _user: str = ""
    _pins: dict[str, str] = field(default_factory=dict)  # of the users, by their names

    @property
    def root(self) -> str:
        """Below which the paths of the proved robot stand."""
        return f"/robots/{self.robots.name}" if self.robots.name else ""

    # Start and end.

    def __enter__(self) -> "Rig":
        self._start_server()
        self._start_client()
        return self

    def _start_server(self) -> None:
        if self.users:
            self._add_users()
        serving = threading.Thread(target=self._serve, name="prove-server", daemon=True)
        self._threads.append(serving)
        serving.start()
        end = time.monotonic() + STARTED_WITHIN_S
        while not self._is_up():
            if self._fault is not None:
                raise KioskError(f"the panel did not start: {self._fault}") from self._fault
            if time.monotonic() > end:
                raise KioskError("the panel did not start in time")
            time.sleep(POLL_S)

    def _start_client(self) -> None:
        self.cookie = self._client = self._held = self._new_cookie()
        if self.users:
            self._sign_in(HOLDER)
        if self.panel.control.required:
            self._take_control()
            holding = threading.Thread(target=self._keep_control, name="prove-control", daemon=True)
            self._threads.append(holding)
            holding.start()
        reading = threading.Thread(target=self._read_events, name="prove-events", daemon=True)
        self._threads.append(reading)
        reading.start()

    def __exit__(self, *_: object) -> None:
        self._ends.set()
        if self._server is not None:
            self._server.should_exit = True
        for thread in self._threads:
            thread.join(STARTED_WITHIN_S)

    def _is_up(self) -> bool:
        return self._server is not None and self._server.started

    def _serve(self) -> None:
        try:
            asyncio.run(self._serve_until_end())
        except Exception as error:  # for the thread that waits for the start
            self._fault = error

    async def _serve_until_end(self) -> None:
        settings = replace(
            Settings.from_environment({}),
            panel=Path("the panel of the proof"), mode="demo", data=self.data, root_path="", dev=False,
        )  # fmt: skip
        self._loop = asyncio.get_running_loop()
        async with AsyncExitStack() as stack:
            oplog = await stack.enter_async_context(open_log(settings, self.panel))
            assets = page_assets(self.panel)
            doctor = DoctorProcess(settings)
            stack.push_async_callback(doctor.stop)
            limits = PressLimits(partial(oplog.suppress, limited=True))
            revision = page_revision(self.panel, assets)
            opened = open_fleet(settings, self.panel, revision, oplog, self._simulate, doctor)
            fleet = await stack.enter_async_context(opened)
            rules = self.panel.access.model_copy(update={"oidc": None, "idle_s": 0.0})
            access = Access(UsersFile(self.data), rules, oplog)
            stack.callback(access.close)
            self._state = await open_state(fleet, assets, oplog, limits, doctor, access)
            await asyncio.to_thread(LOADING.acquire)
            try:
                app = await self._loaded_application(settings, self._state)
            finally:
                LOADING.release()
            listening = socket.create_server(("127.0.0.1", self.port))
            self.port = listening.getsockname()[1]
            config = uvicorn.Config(
                app, log_level="error", timeout_graceful_shutdown=1, lifespan="off", **OPTIONS
            )
            self._server = uvicorn.Server(config)
            await self._server.serve(sockets=[listening])
            fleet.close()

    async def _loaded_application(self, settings: Settings, state: AppState) -> FastAPI:
        """The application with all routes that the proof requests."""
        app = new_application(settings, self.panel.embed)
        app.state.app_state = state
        await load_pages(app, state, self.panel)
        for segment in REQUESTED:
            await app.state.routes.load(segment)
        return app

    @contextmanager
    def _simulate(self, panel: Panel, entry: RobotEntry | None) -> Iterator[str]:
        """The robot as `open_fleet` starts it."""
        name = str(entry.id) if entry else ""
        namespace = entry.namespace if entry else panel.namespace
        interfaces = load_interfaces(panel.distro, panel.interfaces)
        ways = {namespace: way_of(panel, entry or panel)}
        with ExitStack() as stack:
            robots = {namespace: self.robots[name]}
            simulator = Simulator(ANY_PORT, robots, interfaces, ways=ways)
            self._simulators[name] = stack.enter_context(simulator)
            self._simulating[name] = stack
            endpoint = simulator.endpoint
            self._made[name] = partial(Simulator, endpoint, robots, interfaces, ways=ways)
            yield endpoint

    def cut(self, robot: str = "") -> None:
        """The link to a robot, by its id, is cut."""
        self._simulating[robot].close()

    def join_again(self, robot: str = "") -> None:
        """A robot, by its id, is back at its endpoint."""
        make = self._made[robot]
        self._simulators[robot] = self._simulating[robot].enter_context(make())

    def announce_node(self, node: str, *, gone: bool) -> None:
        """A node of the proved robot is there, or gone."""
        self._simulators[self.robots.name].announce_service(f"{node}/{GET[0]}", gone=gone)

    def announce(self, interlock: Interlock, type_name: str = "", *, gone: bool = False) -> None:
        """See `Simulator.announce`, of the robot that publishes it."""
        simulator = self._simulators[self.robots.name_for(interlock)]
        simulator.announce(interlock.topic, type_name, gone=gone)

    def shut_down(self) -> None:
        """The server begins to end: it still answers."""
        assert self._loop is not None
        assert self._state is not None
        done = threading.Event()

        def begin() -> None:
            assert self._state is not None
            for session in self._state.fleet.sessions:
                session.commands.close()
            done.set()

        self._loop.call_soon_threadsafe(begin)
        done.wait(ANSWER_WITHIN_S)

    # What a client does.

    def await_free(self, control: str, within_s: float, *, refused: bool = False) -> bool:
        """Whether the page shows a control as free in time. After a press that was `refused` it waits
        first for the lock, which the page may not have shown yet."""
        shown = self.shown
        if refused:
            shown.wait(lambda: shown.is_locked(control), SETTLED_WITHIN_S)
        return (
            shown.wait(lambda: control in shown.widgets and not shown.is_locked(control), within_s)
            is not None
        )

    def press(
        self, control: str, inputs: Mapping[str, Any], confirmation: str = ""
    ) -> tuple[int, dict[str, Any]]:
        """One press over HTTP, past the page: the status and the receipt."""
        time.sleep(max(0.0, self._pressed_at + PACE_S - time.monotonic()))
        self._pressed_at = time.monotonic()
        body: dict[str, Any] = {"inputs": dict(inputs), "id": secrets.token_hex(8)}
        if confirmation:
            body["confirmation"] = confirmation
        return self.request("POST", f"{self.root}/widgets/{control}", body)

    def confirm(
        self,
        control: str,
        inputs: Mapping[str, Any],
        confirmation: Confirmation,
        wrong: Situation | None = None,
    ) -> str:
        """The confirmation of a press by the user who is signed in, or by a second one; "" if it is
        refused. `wrong` is one of `wrong_confirmations`."""
        if wrong == "unconfirmed":
            return ""
        second, pin = self._entered(confirmation, wrong)
        body = {"inputs": dict(inputs), "pin": pin} | ({"user": second} if second else {})
        answer = self.request("POST", f"{self.root}/widgets/{control}/confirm", body)[1]
        if wrong == "wrong_pin":  # a success forgets the failure, of which too many delay what follows
            self.confirm(control, inputs, confirmation)
        return str(answer.get("confirmation", ""))

    def _entered(self, confirmation: Confirmation, wrong: Situation | None) -> tuple[str, str]:
        """The second person, "" where the user who is signed in confirms, and a PIN."""
        second = ""
        if confirmation == "two_persons":
            second = self._user if wrong == "same_person" else name_of(SECOND)
        pin = self._pins.get(second or self._user, "")
        return second, f"{(int(pin or 0) + 1) % 1_000_000:06}" if wrong == "wrong_pin" else pin

    def acknowledge(
        self,
        alarm: str,
        occurrence: int,
        confirmation: Confirmation = "",
        wrong: Situation | None = None,
    ) -> tuple[int, dict[str, Any]]:
        """Acknowledges an alarm over HTTP, past the page; what a person confirms by the form of the
        sheet. `wrong` as in `confirm`: without a confirmation it is tried in each way. The status and
        what `request` returns, of the last try."""
        path = f"/alarms/{quote(alarm, safe='')}/acknowledge"
        if not confirmation or wrong == "unconfirmed":
            self.request("POST", "/alarms/acknowledge", {"alarms": {alarm: occurrence}})
            answer = self.request("POST", path, {"occurrence": occurrence})
            if not confirmation:
                return answer
        form = {"occurrence": str(occurrence)}
        if wrong != "unconfirmed":
            second, pin = self._entered(confirmation, wrong)
            form |= {"_enter": "yes", "_pin": pin} | ({"_user": second} if second else {})
        return self._exchange("POST", path, urlencode(form), self.cookie)[:2]

    @contextmanager
    def signed_in(self, persona: Persona) -> Iterator[None]:
        """The rig's own client is another user within the block."""
        try:
            self._sign_in(persona)
            yield
        finally:
            self._sign_in(HOLDER)

    def _sign_in(self, persona: Persona) -> None:
        name = name_of(persona)
        status, answer, cookies = self._exchange(
            "POST", "/session", {"user": name, "pin": self._pins[name]}, self._client
        )
        if status != 200:
            raise KioskError(f"{name} can't sign in: {answer}")
        self.cookie = self._held = f"{self._client}; {cookies}"
        self._user = name
        if self.panel.control.required:
            self._take_control()

    def _take_control(self) -> None:
        self.request("POST", f"{self.root}/control/take", {"id": secrets.token_hex(8)})

    def _add_users(self) -> None:
        """The users that the proof needs, with PINs that it knows."""

        def edit(book: UserBook) -> UserBook:
            for persona in dict.fromkeys((HOLDER, SECOND, *self.users)):
                name = name_of(persona)
                pin = self._pins[name] = f"{secrets.randbelow(1_000_000):06}"
                user = User(name, persona.role, tuple(sorted(persona.groups)), hashed(pin, QUICK))
                book = book.with_user(user, "proof").with_change(
                    "proof", "add", name, persona.role, "proof"
                )
            return book

        self.data.mkdir(mode=0o700, parents=True, exist_ok=True)
        UsersFile(self.data).edit(edit)

    def request(
        self, method: str, path: str, body: Mapping[str, Any] | None = None, cookie: str = ""
    ) -> tuple[int, dict[str, Any]]:
        """A request with JSON; its status and its JSON, of a redirect its "location", {} for another
        answer."""
        return self._exchange(method, path, body, cookie or self.cookie)[:2]

    def _exchange(
        self, method: str, path: str, body: Mapping[str, Any] | str | None, cookie: str
    ) -> tuple[int, dict[str, Any], str]:
        """The same with the cookies that it sets. A text is that of a form."""
        is_form = isinstance(body, str)
        content = body if body is None or isinstance(body, str) else json.dumps(body)
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=ANSWER_WITHIN_S)
        try:
            headers = {
                "accept": "application/json", "content-type": FORM if is_form else "application/json",
                "cookie": cookie,
            }  # fmt: skip
            connection.request(method, path, content, headers)
            answer = connection.getresponse()
            text = answer.read()
        finally:
            connection.close()
        if location := answer.getheader("location"):
            return answer.status, {"location": location}, cookies_of(answer)
        try:
            return answer.status, json.loads(text), cookies_of(answer)
        except ValueError:
            return answer.status, {}, cookies_of(answer)

    def _new_cookie(self) -> str:
        """The cookie of a client that has not been here yet."""
        headers, path = {"accept": "text/html", "sec-fetch-dest": "document"}, "/"
        while path:  # of several robots it leads to the first
            connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=ANSWER_WITHIN_S)
            try:
                connection.request("GET", path, headers=headers)
                answer = connection.getresponse()
                answer.read()
            finally:
                connection.close()
            path = answer.getheader("location", "")
        return cookies_of(answer)

    @contextmanager
    def as_stranger(self) -> Iterator[None]:
        """Requests within the block are those of another client."""
        own, self.cookie = self.cookie, self._new_cookie()
        try:
            yield
        finally:
            self.cookie = own

    def _keep_control(self) -> None:
        """As the page of a holder that is touched."""
        while not self._ends.wait(KEPT_EVERY_S):
            with suppress(OSError, http.client.HTTPException):
                self.request("POST", f"{self.root}/control/here", {"touched": True}, self._held)

    def _read_events(self) -> None:
        while not self._ends.is_set():
            with suppress(OSError, http.client.HTTPException, ValueError):
                self._read_stream()
            time.sleep(POLL_S)

    def _read_stream(self) -> None:
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=60)
        try:
            connection.request("GET", f"{self.root}/events", headers={"cookie": self.cookie})
            for event in read_events(iter(connection.getresponse().readline, b"")):
                if self._ends.is_set():
                    break
                self.shown.take(event)
        finally:
            connection.close()


def name_of(persona: Persona) -> str:
    """The name of a user of the proof."""
    return " ".join(["proof", persona.role, *sorted(persona.groups)])


def cookies_of(answer: http.client.HTTPResponse) -> str:
    """The cookies that an answer sets, as a request has them."""
    return "; ".join(each.partition(";")[0] for each in answer.msg.get_all("set-cookie", []))

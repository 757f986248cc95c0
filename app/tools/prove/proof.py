"""Makes the proof: starts a panel for each round of interlocks, brings about each situation, and
compares what the page shows and what the server answers with what must be.

A case holds if the control is locked with a reason that names its interlock, nothing arrives at the
robot though it is pressed past the page, and it works where everything permits.
"""

import json
import tempfile
import threading
import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import nullcontext, suppress
from functools import partial
from pathlib import Path
from typing import Any, Final

from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Origin

from app.cell.alarms.published import entry_name
from app.cell.commands.holds import RELEASED
from app.cell.recipes.book import FOLDER, RecipeFolder
from app.cell.recipes.recipe import checked_values, new_recipe
from app.panel.alarm import Alarm
from app.panel.condition import Interlock
from app.panel.model import Panel
from app.panel.robot_panels import panel_of
from app.panel.template import input_ids
from app.panel.widgets.families import Command, Input
from app.panel.widgets.hold import HoldCommand
from app.panel.widgets.parameter import Parameter
from app.panel.widgets.parts import parts_of
from app.panel.widgets.place import PlaceInput
from app.panel.widgets.publish import Step
from app.panel.widgets.recipe_load import RecipeLoad
from app.panel.widgets.switch import Switch
from app.panel.widgets.templated import is_stop
from app.records.entry import GOOD_OUTCOMES
from app.system.texts import render
from app.tools.prove.browser import PageView, Seen, has_browser
from app.tools.prove.cases import (
    MOST_WAITED_S,
    Guarded,
    HoldEnd,
    Persona,
    Plan,
    Situation,
    alarm_key,
    entry_of,
    names_interlock,
    plan_of,
    situations,
    wrong_confirmations,
)
from app.tools.prove.result import Proof, Result
from app.tools.prove.rig import HOLDER, Rig
from app.tools.prove.robot import ProvingRobots

AT_ONCE: Final = 3  # rounds
SHOWN_WITHIN_S: Final = 3.0  # a lock or its end, on the page
JOINED_WITHIN_S: Final = 15.0
QUIET_S: Final = 0.15  # in which what was sent wrongly would arrive
STOPPED_WITHIN_S: Final = 1.0  # of a hold, from its end
RAISED_WITHIN_S: Final = 3.0
LOST_WITHIN_S: Final = 20.0  # also counted from the start of the server
OVER: Final = frozenset({"", "normal", "returned", "latched"})  # states of an alarm
BROWSER_WITHIN_S: Final = 5.0  # on a busy machine a page is drawn late
ENDED_WITHIN_S: Final = 12.0  # a goal of the simulated robot
BEATS_S: Final = 0.08
HELD_S: Final = 0.3
TRIES: Final = 5  # of a press that must be done
REFUSED: Final = "the server refuses it"
ENDED: Final = "the server ended the hold"
LATE: Final = frozenset({"hold_by_heartbeat", "hold_by_stall"})  # beats: codes of an end
AGAIN: Final = (REFUSED, ENDED)  # begin faults after which an operator presses again
RECIPE: Final = "proof"  # the id of the recipe that is loaded, of each set
OTHER_TYPES: Final = ("std_msgs/msg/Int8", "std_msgs/msg/Float64")  # one of them differs


def is_held(answer: Mapping[str, Any]) -> bool:
    return answer.get("state") == "held"


def prove(
    panel: Panel,
    on_result: Callable[[Result], None] = lambda _: None,
    *,
    with_browser: bool = True,
    longest_s: float = MOST_WAITED_S,
) -> Proof:
    """The proof of a panel, for each of its robots; `with_browser`: its pages are looked at in Chromium
    too, if there is one. Alarms that take longer than `longest_s` are left out. KioskError if the panel
    can't be served."""
    began, proof = time.monotonic(), Proof()
    proof.browser = has_browser() if with_browser else ""
    lock = threading.Lock()

    def tell(result: Result) -> None:
        with lock:
            proof.results.append(result)
        on_result(result)

    looks = bool(proof.browser)

    def examine(robot: str, plan: Plan, chosen: Sequence[Interlock], folder: Path) -> None:
        """A round of interlocks, or without any the panel as a whole."""
        make = partial(_Round, panel, robot, plan, tell=tell)
        if chosen:
            make(folder=folder, looks=looks).interlocks(chosen)
        else:
            make(folder=folder / "whole", looks=looks).whole()
            make(folder=folder / "ending", looks=False).ending()

    def examine_roles(robot: str, plan: Plan, folder: Path) -> None:
        users = plan.personas
        _Round(panel, robot, plan, folder=folder, tell=tell, looks=False, users=users).roles()

    with (
        tempfile.TemporaryDirectory(prefix="operator-panel-proof-") as folder,
        ThreadPoolExecutor(AT_ONCE) as pool,
    ):
        rounds: list[Future[None]] = []
        for robot in [str(entry.id) for entry in panel.robots] or [""]:
            plan = plan_of(panel_of(panel, robot or None), robot, longest_s)
            named = f"{robot}: " if robot else ""
            proof.left_out |= {f"{named}{name}": why for name, why in plan.left_out.items()}
            place = Path(folder) / (robot or "only")
            rounds.append(pool.submit(examine, robot, plan, (), place))  # the longest first
            rounds.append(pool.submit(examine_roles, robot, plan, place / "roles"))
            for number, chosen in enumerate(plan.rounds):
                rounds.append(pool.submit(examine, robot, plan, chosen, place / str(number)))
        for examined in rounds:
            examined.result()  # what a round raises is raised here
    proof.took_s = time.monotonic() - began
    return proof


class _Round:
    """One running panel, and the situations that it is brought into."""

    def __init__(
        self,
        panel: Panel,
        robot: str,
        plan: Plan,
        *,
        folder: Path,
        tell: Callable[[Result], None],
        looks: bool,
        users: Sequence[Persona] = (),
    ) -> None:
        """`robot` is the id of the one that is proved, of several; `looks`: its pages are looked at in
        a browser. The panel has `users`, and also without any where a person confirms a press."""
        self._robot_name = robot
        self._plan = plan
        self._tell = tell
        self._robots = ProvingRobots(panel, robot)
        self._robot = self._robots.own
        if plan.has_confirmations:
            users = (*users, HOLDER)
        self._rig = Rig(panel, self._robots, folder / "data", users=users)
        self._panel = panel = panel_of(panel, robot or None)
        self._keep_recipes(folder / "data" / FOLDER)
        self._view = PageView(folder / "browser") if looks else None
        self._pages = {
            str(widget.id): str(page.id)
            for page in reversed(panel.pages)
            for widget in (*page.widgets, *panel.frame.widgets)
        }
        self._inputs = {str(w.id): w for w in panel.widgets() if isinstance(w, Input)}
        self._said = self._code = ""  # of the last press

    def _keep_recipes(self, folder: Path) -> None:
        """A recipe of each set, with examples as its values."""
        for guarded in self._plan.controls.values():
            if isinstance(load := guarded.control, RecipeLoad):
                examples = {field.id: self._value_of_input(field) for field in load.fields}
                values = checked_values(load.fields, examples)
                recipe = new_recipe(RECIPE, "created", time.time(), "proof", "Proof", values)
                RecipeFolder(folder / load.id).write(recipe)

    # Rounds.

    def interlocks(self, chosen: Sequence[Interlock]) -> None:
        """The situations of some interlocks, of which no control has two."""
        together = {guard for each in chosen for guard in self._together(each)}
        self._robots.permit(chosen, together)
        self._robots.silence(chosen)
        with self._rig, self._view or nullcontext():
            self._await_link()
            self._locked("never_seen", chosen, time.monotonic())
            self._permitted(chosen, together)
            self._forbidden(chosen, together)
            self._permitted(chosen, together, again=True)
            aged = [each for each in chosen if each.max_age_s is not None]
            if aged:
                self._robots.silence(aged)
                self._locked("old", aged, time.monotonic())
                self._permitted(chosen, together, again=True)
            self._announced("other_type", chosen, chosen, together)
            required = [each for each in chosen if each.require_publisher]
            self._announced("publisher_gone", required, chosen, together)
            for each in chosen:
                for guarded in self._guarded(each):
                    if isinstance(guarded.control, HoldCommand):
                        self._permit_others(guarded, each)
                        self._await_free(str(guarded.control.id))
                        self._hold(guarded, "forbids", each)
            self._without_others(chosen, together)

    def _without_others(self, chosen: Sequence[Interlock], together: Collection[str]) -> None:
        """The robots of interlocks that are of others are lost, and stay so."""
        for each in chosen:
            if "robot_lost" in situations(each, self._plan.robot):
                self._permitted(chosen, together, again=True)
                began = time.monotonic()
                self._rig.cut(self._robots.name_for(each))
                for guarded in self._guarded(each):
                    self._cut_off(guarded, "robot_lost", began, each.id)

    def whole(self) -> None:
        """What concerns the panel as a whole: controls without interlocks, holds, alarms, the link, the
        end of the server."""
        interlocks = [*self._plan.interlocks.values()]
        self._robots.permit(())
        with self._rig, self._view or nullcontext():
            self._await_link()
            for guarded in self._plan.controls.values():
                if not guarded.guards:
                    self._works(guarded, "")
            if self._panel.control.required:
                self._without_right("no_control")
            for guarded in self._plan.controls.values():
                if isinstance(guarded.control, HoldCommand):
                    self._permit_for(guarded, interlocks)
                    for end in ("released", "page_gone", "no_beat"):
                        self._hold(guarded, end, None)
            self._robots.permit(())
            for alarm in self._plan.alarms:
                if alarm.source != "lost":
                    self._alarm(alarm)
            began = time.monotonic()
            self._rig.cut(self._robots.name)
            for guarded in self._plan.controls.values():
                self._cut_off(guarded, "link_cut", began)
            self._lost()

    def ending(self) -> None:
        """The server begins to end while everything permits."""
        interlocks = [*self._plan.interlocks.values()]
        self._robots.permit(())
        with self._rig:
            self._await_link()
            self._rig.shut_down()
            for guarded in self._plan.controls.values():
                self._permit_for(guarded, interlocks)
                self._refused_at_end(guarded)

    def _permit_for(self, guarded: Guarded, interlocks: Sequence[Interlock]) -> None:
        chosen = [each for each in interlocks if each.id in guarded.guards]
        self._robots.permit(chosen, guarded.guards)
        self._await_free(str(guarded.control.id))

    # Situations.

    def _await_link(self) -> None:
        """Until the robot is joined: a control without interlocks is not locked then, or else some time
        has passed."""
        free = [name for name, guarded in self._plan.controls.items() if not guarded.guards]
        if free:
            self._rig.shown.wait(
                lambda: any(not self._rig.shown.is_locked(name) for name in free) and self._knows(),
                JOINED_WITHIN_S,
            )
        else:
            self._rig.shown.wait(self._knows, JOINED_WITHIN_S)
        time.sleep(1.5)  # what is replayed after joining counts as known from then on

    def _knows(self) -> bool:
        return all(name in self._rig.shown.widgets for name in self._plan.controls)

    def _permitted(
        self, chosen: Sequence[Interlock], together: Collection[str], *, again: bool = False
    ) -> None:
        """Everything permits: each control works. `again`: only that it is not locked any more."""
        self._robots.permit(chosen, together)
        for interlock in chosen:
            for guarded in self._guarded(interlock):
                name = str(guarded.control.id)
                self._permit_others(guarded, interlock)
                if again:
                    self._await_free(name)
                else:
                    self._works(guarded, interlock.id)

    def _await_free(self, name: str) -> None:
        self._rig.await_free(name, SHOWN_WITHIN_S)

    def _permit_others(self, guarded: Guarded, interlock: Interlock) -> None:
        """Interlocks of this control on the field of another round have a value that permits it."""
        others = [each for name, each in self._plan.interlocks.items() if name in guarded.guards]
        ordered = sorted(others, key=lambda each: each.id == interlock.id)  # the last decides its field
        self._robots.permit(ordered, guarded.guards)

    def _forbidden(self, chosen: Sequence[Interlock], together: Collection[str]) -> None:
        began = time.monotonic()
        for interlock in chosen:
            self._robots.forbid(interlock, together)
        self._locked("forbids", chosen, began)

    def _announced(
        self,
        situation: Situation,
        changed: Sequence[Interlock],
        chosen: Sequence[Interlock],
        together: Collection[str],
    ) -> None:
        """The publishers of some interlocks have another type, or are gone."""
        if not changed:
            return
        began = time.monotonic()
        for interlock in changed:
            other = next(name for name in OTHER_TYPES if name != interlock.type)
            self._rig.announce(interlock, other, gone=situation == "publisher_gone")
        self._locked(situation, changed, began)
        for interlock in changed:
            self._rig.announce(interlock)
        self._permitted(chosen, together, again=True)

    # What must be.

    def _locked(self, situation: Situation, chosen: Sequence[Interlock], began: float) -> None:
        """Each control of these interlocks is locked by them, and a press past the page is refused."""
        for interlock in chosen:
            within_s = SHOWN_WITHIN_S + (interlock.max_age_s or 0.0)
            for guarded in self._guarded(interlock):
                name = str(guarded.control.id)
                at = self._rig.shown.wait(partial(self._is_locked_by, name, interlock), within_s)
                fault = self._why_not_locked(name, interlock) if at is None else ""
                fault = fault or self._seen(name, locked=True, interlock=interlock)
                fault = fault or self._refuses(guarded)
                timed = None if at is None or situation == "never_seen" else max(0.0, at - began)
                self._report(name, interlock.id, situation, fault, timed)

    def _is_locked_by(self, name: str, interlock: Interlock) -> bool:
        shown = self._rig.shown
        return shown.is_locked(name) and names_interlock(shown.reasons(name), interlock)

    def _why_not_locked(self, name: str, interlock: Interlock) -> str:
        if not self._rig.shown.is_locked(name):
            return "the page shows it as free"
        return f'the reason does not name "{render(interlock.name)}": {self._rig.shown.reasons(name)}'

    def _seen(self, name: str, *, locked: bool, interlock: Interlock | None = None) -> str:
        """That the browser shows a control as it is; "" if so, and where no page has a button for
        it."""
        page = self._pages.get(name)
        if self._view is None or page is None:
            return ""
        url = f"http://127.0.0.1:{self._rig.port}{self._rig.root}/pages/{page}"
        self._view.open(url, self._rig.cookie)

        def is_right(seen: Seen) -> bool:
            is_named = interlock is None or names_interlock(seen.text, interlock)
            return seen.locked is locked and is_named

        seen = self._view.shows(name, is_right, BROWSER_WITHIN_S)
        if seen.locked is None:
            return ""
        if seen.locked is not locked:
            return f"the browser shows it as {'free' if locked else 'locked'}"
        if interlock is not None and not names_interlock(seen.text, interlock):
            return f'what the browser says does not name "{render(interlock.name)}": {seen.text:.200}'
        return ""

    def _refuses(self, guarded: Guarded, confirmation: str | None = None) -> str:
        """That the server refuses a press past the page, and that nothing is sent; "" if so. It goes
        with this confirmation, or with one that is asked for."""
        before = self._arrived(guarded)
        answer = self._press(guarded, confirmation=confirmation)
        time.sleep(QUIET_S)
        if self._arrived(guarded) != before:
            return f"something was sent to the robot though it is locked: {answer}"
        if answer in GOOD_OUTCOMES:
            return f"the server answered {answer} to a press past the page"
        return ""

    def _works(self, guarded: Guarded, guard: str) -> None:
        """That a press arrives at the robot where everything permits."""
        name = str(guarded.control.id)
        began = time.monotonic()
        at = self._rig.shown.wait(lambda: not self._rig.shown.is_locked(name), SHOWN_WITHIN_S)
        if at is None:
            self._leave_out(name, guard, self._rig.shown.reasons(name))
            return
        took_s = max(0.0, at - began)
        if fault := self._seen(name, locked=False):
            self._report(name, guard, "permits", fault, took_s)
            return
        self._report(name, guard, "permits", self._arrives(guarded), took_s)

    def _arrives(self, guarded: Guarded) -> str:
        """That what a press sends arrives at the robot; "" if so."""
        is_hold = isinstance(guarded.control, HoldCommand)
        send = self._held_for_a_moment if is_hold else self._pressed
        return self._tried(guarded, lambda: (send(guarded), None))[0]

    def _pressed(self, guarded: Guarded) -> str:
        before = self._arrived(guarded)
        answer = self._press(guarded)
        if self._code == "switch_reported_already":
            answer = self._press(guarded, is_on=False)
        if answer == "refused":
            return f"{REFUSED}: {self._said}"
        arrived = self._within(lambda: self._arrived(guarded) != before, SHOWN_WITHIN_S)
        shown, name = self._rig.shown, str(guarded.control.id)
        shown.wait(lambda: not shown.widgets.get(name, {}).get("busy"), ENDED_WITHIN_S)
        return "" if arrived else f"nothing arrived at the robot: {answer}, {self._said}"

    def _leave_out(self, name: str, guard: str, reason: str) -> None:
        fault = f"it is locked while everything permits: {reason}"
        self._report(name, guard, "permits", fault)

    def _without_right(self, situation: Situation) -> None:
        """Another client without control, or one without a role, presses each control: the server
        refuses, and nothing is sent. A stop needs neither."""
        with self._rig.as_stranger():
            for guarded in self._plan.controls.values():
                if not is_stop(guarded.control):
                    self._report(str(guarded.control.id), "", situation, self._refuses(guarded))

    def roles(self) -> None:
        """With users: a client that is not signed in presses each control, then users with just the
        role that it needs and with the one below. What a person confirms is confirmed wrongly."""
        interlocks = [*self._plan.interlocks.values()]
        self._robots.permit(())
        with self._rig:
            self._await_link()
            self._without_right("no_role")
            for guarded in self._plan.confirmed:
                self._permit_for(guarded, interlocks)
                self._unconfirmed(guarded)
            for persona in self._plan.personas:
                with self._rig.signed_in(persona):
                    for guarded in self._plan.controls.values():
                        if persona == guarded.enough:
                            self._permit_for(guarded, interlocks)
                            fault = self._arrives(guarded)
                            self._await_free(str(guarded.control.id))  # its page follows the sign-in
                            self._report(str(guarded.control.id), "", "role_enough", fault)
                        elif persona == guarded.less:
                            self._permit_for(guarded, interlocks)
                            fault = self._refuses(guarded)
                            self._report(str(guarded.control.id), "", "role_less", fault)

    def _unconfirmed(self, guarded: Guarded) -> None:
        """A press is refused without a confirmation, and with one that was not given."""
        name, values = str(guarded.control.id), self._values(guarded)
        for situation in wrong_confirmations(guarded.confirmation):
            confirmation = self._rig.confirm(name, values, guarded.confirmation, situation)
            self._report(name, "", situation, self._refuses(guarded, confirmation))

    def _cut_off(self, guarded: Guarded, situation: Situation, began: float, guard: str = "") -> None:
        name = str(guarded.control.id)
        at = self._rig.shown.wait(lambda: self._rig.shown.is_locked(name), 2 * SHOWN_WITHIN_S)
        fault = "the page shows it as free" if at is None else self._seen(name, locked=True)
        fault = fault or self._refuses(guarded)
        self._report(name, guard, situation, fault, None if at is None else max(0.0, at - began))

    def _refused_at_end(self, guarded: Guarded) -> None:
        fault = self._refuses(guarded)
        self._report(str(guarded.control.id), "", "shutdown", fault)

    # Presses and holds.

    def _press(self, guarded: Guarded, *, is_on: bool = True, confirmation: str | None = None) -> str:
        """The outcome of a press past the page, or of the begin of a hold. A switch is set to
        `is_on`; `confirmation` as in `_refuses`."""
        if isinstance(guarded.control, HoldCommand):
            return self._begin_refused(guarded, confirmation)
        values = self._values(guarded)
        if isinstance(guarded.control, Switch):
            values[str(guarded.control.id)] = is_on
        if confirmation is None:
            confirmation = self._confirmed(guarded, values)
        status, receipt = self._rig.press(str(guarded.control.id), values, confirmation)
        self._code = str(receipt.get("code", ""))
        self._said = f"{receipt.get('reason') or receipt.get('error') or ''} ({status})"
        return str(receipt.get("outcome", "")) or f"status {status}"

    def _confirmed(self, guarded: Guarded, values: Mapping[str, Any]) -> str:
        """The confirmation of a press with these values; "" where none is needed or given."""
        if not guarded.confirmation:
            return ""
        return self._rig.confirm(str(guarded.control.id), values, guarded.confirmation)

    def _values(self, guarded: Guarded) -> dict[str, Any]:
        """Values of the inputs that a control sends."""
        needed = input_ids(guarded.control)
        own = {name: self._inputs[name] for name in needed if name in self._inputs}
        values = {name: self._value_of_input(widget) for name, widget in own.items()}
        own_value = value_of(guarded.control)
        return values if own_value is None else {**values, str(guarded.control.id): own_value}

    def _value_of_input(self, widget: Input) -> Any:
        """An example, and of places one that the panel file has."""
        if isinstance(widget, PlaceInput):
            return next(iter(widget.places or [place.id for place in self._panel.places]), "none")
        return widget.examples()[0]

    def _socket(self, guarded: Guarded) -> ClientConnection:
        address = f"127.0.0.1:{self._rig.port}"
        path = f"{self._rig.root}/widgets/{guarded.control.id}/hold"
        headers, origin = {"cookie": self._rig.cookie}, Origin(f"http://{address}")
        return connect(f"ws://{address}{path}", origin=origin, proxy=None, additional_headers=headers)

    def _begin_refused(self, guarded: Guarded, confirmation: str | None) -> str:
        with self._socket(guarded) as socket:
            try:
                begun = self._begin(socket, guarded, confirmation)
                return "published" if is_held(begun) else "refused"
            except ConnectionClosed:
                return "refused"

    def _begin(
        self, socket: ClientConnection, guarded: Guarded, confirmation: str | None = None
    ) -> dict[str, Any]:
        """The answer to the begin of a hold. `confirmation` as in `_refuses`."""
        stamp, values = json.loads(socket.recv(5))["stamp"], self._values(guarded)
        if confirmation is None:
            confirmation = self._confirmed(guarded, values)
        begin = {
            "do": "begin", "inputs": values, "seen": self._rig.shown.event_id,
            "stamp": stamp, "after": 1, "confirmation": confirmation,
        }  # fmt: skip
        socket.send(json.dumps(begin))
        answer: dict[str, Any] = json.loads(socket.recv(5))
        return answer

    def _tried(
        self, guarded: Guarded, attempt: Callable[[], tuple[str, float | None]]
    ) -> tuple[str, float | None]:
        """Begins again, as an operator does, what is refused because the state has just changed, and a
        hold that ends because this machine had no time for its beats."""
        for _ in range(TRIES - 1):
            fault, took_s = attempt()
            if not fault.startswith(AGAIN):
                return fault, took_s
            name = str(guarded.control.id)
            self._rig.await_free(name, SHOWN_WITHIN_S, refused=fault.startswith(REFUSED))
        return attempt()

    def _held_for_a_moment(self, guarded: Guarded) -> str:
        """That a hold is sent while it is held; "" if so."""
        topic = str(getattr(guarded.control, "topic", ""))
        before = self._robot.arrived[topic]
        with self._socket(guarded) as socket:
            try:
                if not is_held(held := self._begin(socket, guarded)):
                    return f"{REFUSED}: {held.get('reason')}"
                if ended := self._beat(socket, held, HELD_S):
                    return f"{ENDED}: {ended.get('reason')}"
            except ConnectionClosed as closed:
                return f"{ENDED}: {closed}"
        return "" if self._robot.arrived[topic] > before else "nothing arrived at the robot"

    def _beat(self, socket: ClientConnection, held: dict[str, Any], for_s: float) -> dict[str, Any]:
        """Holds for some time; `held` has the stamp of the last answer, and the number of the last
        beat. The receipt if the server has ended it, {} if it has not."""
        end = time.monotonic() + for_s
        while time.monotonic() < end:
            held["number"] = number = held.get("number", 0) + 1
            beat = {"do": "beat", "number": number, "lease": held["lease"], "stamp": held["stamp"]}
            socket.send(json.dumps({**beat, "after": 1}))
            answer = json.loads(socket.recv(5))
            if not is_held(answer):
                return dict(answer)
            held["stamp"] = answer["stamp"]
            time.sleep(BEATS_S)
        return {}

    def _hold(self, guarded: Guarded, end: HoldEnd, interlock: Interlock | None) -> None:
        """A hold that ends in a way: how long until the last message has left."""
        name, guard = str(guarded.control.id), interlock.id if interlock else ""

        def attempt() -> tuple[str, float | None]:
            try:
                with self._socket(guarded) as socket:
                    return self._held_until(socket, guarded, end, interlock)
            except (ConnectionClosed, TimeoutError) as closed:
                return f"{ENDED}: {closed}", None

        fault, took_s = self._tried(guarded, attempt)
        self._report(name, guard, end, fault, took_s, kind="hold")

    def _held_until(
        self, socket: ClientConnection, guarded: Guarded, end: HoldEnd, interlock: Interlock | None
    ) -> tuple[str, float | None]:
        """Holds for a moment, brings about the end, and looks whether it stops."""
        if not is_held(held := self._begin(socket, guarded)):
            return f"{REFUSED}: {held.get('reason')}", None
        if ended := self._beat(socket, held, HELD_S):
            return f"{ENDED}: {ended.get('reason')}", None
        began = time.monotonic()
        if end == "released":
            done = {"do": "end", "why": "released", "lease": held["lease"]}
            socket.send(json.dumps({**done, "stamp": held["stamp"], "after": 1}))
            if (answer := json.loads(socket.recv(5))).get("code") != RELEASED:
                return f"{ENDED}: {answer.get('reason')}", None
        elif end == "page_gone":
            socket.close()
        elif interlock is not None:
            self._robots.forbid(interlock, guarded.guards)
            stays_until = began + 2 * STOPPED_WITHIN_S
            with suppress(ConnectionClosed):  # the finger stays on it
                while time.monotonic() < stays_until:
                    ended = self._beat(socket, held, stays_until - time.monotonic())
                    if ended.get("code") in LATE:
                        self._permit_others(guarded, interlock)
                        return f"{ENDED}: {ended.get('reason')}", None
                    time.sleep(BEATS_S)
        return self._stopped(str(getattr(guarded.control, "topic", "")), began)

    def _stopped(self, topic: str, began: float) -> tuple[str, float | None]:
        """That nothing comes any more soon after the end; with the time of the last message."""
        time.sleep(STOPPED_WITHIN_S)
        count = self._robot.arrived[topic]
        time.sleep(QUIET_S)
        last_s = max(0.0, self._robot.arrived_at.get(topic, began) - began)
        if self._robot.arrived[topic] != count or last_s > STOPPED_WITHIN_S:
            return f"it is still sent {last_s:.1f} s after its end", None
        return "", last_s

    # Alarms.

    def _alarm(self, alarm: Alarm) -> None:
        """Raised, shown within its time, acknowledged, returned."""
        if alarm.node:
            self._rig.announce_node(alarm.node, gone=True)
        else:
            self._robot.set_alarm(alarm, raised=True)
        fault, took_s = self._raised(alarm, RAISED_WITHIN_S + (alarm.stale_s or 0.0))
        if alarm.node:
            self._rig.announce_node(alarm.node, gone=False)
        else:
            self._robot.set_alarm(alarm, raised=False)
        fault = fault or self._returned(alarm, RAISED_WITHIN_S)
        self._report(str(alarm.id), "", "raised", fault, took_s, kind="alarm")

    def _lost(self) -> None:
        """The alarms of a lost link, while it is lost; then the robot is back."""
        alarms = [alarm for alarm in self._plan.alarms if alarm.source == "lost"]
        if not alarms:
            return
        raised = [(alarm, *self._raised(alarm, LOST_WITHIN_S)) for alarm in alarms]
        self._rig.join_again(self._robots.name)
        for alarm, fault, took_s in raised:
            fault = fault or self._returned(alarm, JOINED_WITHIN_S)
            self._report(str(alarm.id), "", "raised", fault, took_s, kind="alarm")

    def _raised(self, alarm: Alarm, within_s: float) -> tuple[str, float | None]:
        """That it is shown in time after its on-delay, and can be acknowledged; with the time that it
        took."""
        began, within_s = time.monotonic(), within_s + alarm.on_delay_s
        if self._within(lambda: self._alarm_state(alarm) == "active", within_s):
            return self._acknowledged(alarm), time.monotonic() - began
        state = self._alarm_state(alarm)
        return f"it is not shown {within_s:g} s after it was raised: {state or 'normal'}", None

    def _returned(self, alarm: Alarm, within_s: float) -> str:
        """That it returns in time after its off-delay; "" if so."""
        is_over = self._within(lambda: self._alarm_state(alarm) in OVER, within_s + alarm.off_delay_s)
        return "" if is_over else f"it does not return: {self._alarm_state(alarm)}"

    def _acknowledged(self, alarm: Alarm) -> str:
        """That it can be acknowledged, with `confirm_act` only where a person confirms it; "" if so."""
        if alarm.ack == "none":
            return ""
        key, confirmation = self._alarm_key(alarm), alarm.confirm_act or ""
        acknowledge = partial(self._rig.acknowledge, key, self._alarm_row(alarm).get("occurrence", 0))
        for wrong in wrong_confirmations(confirmation) if confirmation else ():
            status = acknowledge(confirmation, wrong)[0]
            fault = f"it is acknowledged ({status})" if self._is_acknowledged(alarm) else ""
            self._report(str(alarm.id), "", wrong, fault, kind="alarm")
        answer = acknowledge(confirmation)
        return "" if self._is_acknowledged(alarm) else f"it can't be acknowledged: {answer}"

    def _is_acknowledged(self, alarm: Alarm) -> bool:
        return self._alarm_row(alarm).get("acknowledged") is True

    def _alarm_key(self, alarm: Alarm) -> str:
        key, entry = alarm_key(str(alarm.id), self._robot_name), entry_of(alarm)
        return f"{key}:{entry_name(entry)}" if entry else key

    def _alarm_row(self, alarm: Alarm) -> dict[str, Any]:
        rows, key = self._rig.request("GET", "/alarms")[1].get("alarms", []), self._alarm_key(alarm)
        return next((row for row in rows if row["id"] == key), {})

    def _alarm_state(self, alarm: Alarm) -> str:
        return str(self._alarm_row(alarm).get("state", ""))

    # Helpers.

    def _guarded(self, interlock: Interlock) -> Iterator[Guarded]:
        return (each for each in self._plan.controls.values() if interlock.id in each.guards)

    def _together(self, interlock: Interlock) -> frozenset[str]:
        """The interlocks that guard a control with this one."""
        return frozenset().union(*(guarded.guards for guarded in self._guarded(interlock)))

    def _arrived(self, guarded: Guarded) -> int:
        """How many messages, requests and goals of a control have arrived."""
        return sum(self._robot.arrived[name] for name in names_of(guarded.control))

    def _within(self, condition: Callable[[], bool], within_s: float) -> bool:
        end = time.monotonic() + within_s
        while not condition():
            if time.monotonic() >= end:
                return False
            time.sleep(0.02)
        return True

    def _report(
        self,
        name: str,
        guard: str,
        situation: str,
        fault: str,
        took_s: float | None = None,
        kind: str = "control",
    ) -> None:
        shown = self._rig.shown.reasons(name) if kind == "control" else ""
        robot = self._robot_name
        self._tell(Result(kind, name, guard, situation, fault, took_s, shown, robot))


def names_of(control: Command) -> frozenset[str]:
    """The topics, services and actions to which a control sends."""
    names = {
        str(name)
        for part in parts_of(control)
        for name in (getattr(part, key, None) for key in ("topic", "service", "action"))
        if name
    }
    if node := getattr(control, "node", None) or getattr(getattr(control, "set", None), "node", None):
        names |= {f"{node}/set_parameters", f"{node}/set_parameters_atomically"}
    return frozenset(names)


def value_of(control: Command) -> Any:
    """The value that a press of a control has of itself; None where it has none."""
    if isinstance(control, Step):
        return control.min + control.step
    if isinstance(control, RecipeLoad):
        return f"{RECIPE}@1"
    return _example_of(control) if isinstance(control, Parameter) else None


def _example_of(widget: Parameter) -> Any:
    """A value that a parameter may be set to."""
    if widget.options:
        return widget.options[0].value
    if widget.type == "bool":
        return True
    if widget.has_numbers:
        value = widget.min if widget.min is not None else widget.max if widget.max is not None else 0
        return int(value) if widget.element_type == "integer" else float(value)
    return "a"

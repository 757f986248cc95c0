"""What the panel has shown of a case since its step began: judged from the events of its server and the
entries of its log, and kept once it was so."""

import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime
from math import inf
from typing import Any, Final

from app.panel.condition import Interlock
from app.panel.model import Panel
from app.records.entry import GOOD_OUTCOMES
from app.system.printable import readable
from app.system.texts import render
from app.tools.prove.cases import alarm_key, names_interlock, names_robot
from app.tools.prove.steps import Row
from app.tools.prove.watch import Entry, PanelWatch

OVER: Final = frozenset({"", "normal", "returned", "latched"})  # states of an alarm
PRESSED: Final = frozenset({"permits", "no_control", "no_role"})  # where someone may press
LONGEST: Final = 300  # characters of what is shown


@dataclass
class Measure:
    """A case of a step that is under way. `shown` is the newest of it for the person who watches;
    `took_s` is when it was as it must be, after the begin of the step, None before."""

    row: Row
    panel: Panel
    watch: PanelWatch
    stranger: PanelWatch | None = None  # a client without a token
    began: float = field(default_factory=time.monotonic)
    shown: str = ""
    took_s: float | None = None
    _locked_from: float = inf  # seconds since 1970 of the server's clock
    _locked_until: float = inf
    _is_armed: bool = False  # it was seen as it is before the situation
    _reasons_before: str = ""  # while the link was up
    _entry: str = ""  # of an alarm
    _passed: list[str] = field(default_factory=list)

    def look(self) -> None:
        """Reads what is shown now, until it was as it must be."""
        if self.watch.lost:
            return
        if self.took_s is not None:
            if self._is_lock and not self._is_still_locked():
                self._locked_until = min(self._locked_until, self.watch.server_time)
            return
        row = self.row
        if row.kind == "alarm":
            is_met = self._alarm()
        elif row.kind == "hold":
            is_met = self._hold()
        elif row.situation == "permits":
            is_met = self._free() if row.guard else self._press()
        elif row.situation == "no_role":
            is_met = self._locked_for(self.stranger)
        elif row.situation == "no_control":
            is_met = bool(self.watch.shown.control.get("holder")) and self._locked_for(self.watch)
        elif row.situation == "link_cut":
            is_met = self._cut()
        else:
            is_met = self._locked()
        if is_met:
            self.took_s = time.monotonic() - self.began
            self._locked_from = self.watch.server_time

    def _is_still_locked(self) -> bool:
        guard = self.row.guard
        return self.watch.shown.is_locked(self.row.name) and not (guard and self._is_permitted(guard))

    def fault(self) -> str:
        """Why it does not hold by what was measured; "" if it does."""
        if self.took_s is None:
            return f"the panel did not show it: {self.shown or 'nothing'}"
        for entry in self._good_entries() if self._is_lock else ():
            if self._locked_from < _pressed_at(entry) < self._locked_until:
                return f"something was sent though it was locked: {_text_of(entry)}"
        return ""

    @property
    def _is_lock(self) -> bool:
        """Whether the control is locked for everyone."""
        return self.row.kind == "control" and self.row.situation not in PRESSED

    def _interlock(self) -> Interlock:
        return next(each for each in self.panel.every_interlock if each.id == self.row.guard)

    def _is_permitted(self, guard: str) -> bool:
        return self.watch.shown.interlocks.get(guard, {}).get("enabled") is True

    def _free(self) -> bool:
        """The control is free. Of a panel whose control this client does not have: each of its
        interlocks permits."""
        shown, name = self.watch.shown, self.row.name
        if shown.control.get("required"):
            guards = next(each for each in self.panel.commands if each.id == name).interlocks
            forbidding = [guard for guard in guards if not self._is_permitted(guard)]
            self.shown = f"locked by {', '.join(forbidding)}" if forbidding else "its interlocks permit"
            return not forbidding
        is_free = shown.widgets.get(name, {}).get("enabled") is True
        self._say("free" if is_free else f"locked: {shown.reasons(name)}")
        return is_free

    def _locked(self) -> bool:
        """The control is locked with a reason that names the interlock, which permitted before."""
        interlock = self._interlock()
        if self._is_permitted(interlock.id):
            self._is_armed = True
            self._say(f'"{render(interlock.name)}" permits')
            return False
        shown, name = self.watch.shown, self.row.name
        reasons = shown.reasons(name)
        if self._is_armed and shown.control.get("required") and shown.is_locked(name):
            reasons = self.watch.lock_text(name) or reasons
        if not self._is_armed:
            self._say(f'"{render(interlock.name)}" does not permit yet: {reasons}')
        elif not shown.is_locked(name):
            self._say("free")
        else:
            self._say(f"locked: {reasons}")
            return self._is_about(reasons, interlock)
        return False

    def _is_about(self, reasons: str, interlock: Interlock) -> bool:
        """Whether a reason names the interlock, or the robot that is lost. What is said to a client
        without control names the interlock only."""
        if self.row.situation != "robot_lost" or self.watch.shown.control.get("required"):
            return names_interlock(reasons, interlock)
        robot = next(each for each in self.panel.robots if each.id == interlock.robot)
        return names_robot(reasons, robot)

    def _cut(self) -> bool:
        """The control is locked, with another reason than before where it was locked already."""
        shown, name = self.watch.shown, self.row.name
        reasons = shown.reasons(name)
        if shown.link.get("bridge", {}).get("state") == "ok":
            self._is_armed, self._reasons_before = True, reasons
            self._say("the link is up")
            return False
        if self._is_armed:
            self._say(f"locked: {reasons}" if shown.is_locked(name) else "free")
        return self._is_armed and shown.is_locked(name) and reasons != self._reasons_before

    def _locked_for(self, client: PanelWatch | None) -> bool:
        """The control is locked, or not shown, for a client without the right."""
        if client is None or client.lost:
            return False
        shown, name = client.shown, self.row.name
        is_free = shown.widgets.get(name, {}).get("enabled") is True
        self._say("free" if is_free else f"locked: {shown.reasons(name) or 'not shown'}")
        return not is_free

    def _press(self) -> bool:
        entries = [entry for entry in self.watch.entries(self.row.name) if entry["outcome"]]
        if entries:
            self._say(_text_of(entries[-1]))
        return bool(self._good_entries())

    def _good_entries(self) -> list[Entry]:
        return [
            entry
            for entry in self.watch.entries(self.row.name)
            if entry["outcome"] in GOOD_OUTCOMES and entry["action"] in ("press", "hold")
        ]

    def _hold(self) -> bool:
        """A hold has ended in the way of the case: by the finger, or by something else."""
        ended = [
            entry
            for entry in self.watch.entries(self.row.name)
            if entry["action"] == "hold" and entry["outcome"] in ("published", "aborted")
        ]
        if not ended:
            return False
        entry = ended[-1]
        self._say(_text_of(entry))
        if self.row.situation == "released":
            return entry["outcome"] == "published"
        if self.row.situation == "forbids":
            return entry["outcome"] == "aborted" and names_interlock(entry["reason"], self._interlock())
        return entry["outcome"] == "aborted"

    def _alarm_row(self) -> Mapping[str, Any]:
        """The row of the alarm; of one that the robot publishes itself that of the first entry that was
        raised."""
        key, shown = alarm_key(self.row.name, self.watch.robot), self.watch.shown
        if not self._entry:
            entries = [name for name in shown.alarms.get("rows", {}) if name.startswith(f"{key}:")]
            raised = [name for name in entries if shown.alarm(name).get("state") == "active"]
            self._entry = raised[0] if raised else ""
        return shown.alarm(self._entry or key)

    def _alarm(self) -> bool:
        """Raised, acknowledged where that is required, and returned, in this order."""
        alarm = next(each for each in self.panel.alarms if each.id == self.row.name)
        shown = self._alarm_row()
        state, after_s = str(shown.get("state", "")), time.monotonic() - self.began
        if state == "active":
            self._pass("raised", after_s)
        if not self._passed:
            return False
        if alarm.ack == "none" or shown.get("acknowledged") or not shown:
            self._pass("acknowledged", after_s)
        if state in OVER:
            self._pass("returned", after_s)
        self._say(", ".join(self._passed))
        return len(self._passed) == 3

    def _pass(self, stage: str, after_s: float) -> None:
        if not any(passed.startswith(stage) for passed in self._passed):
            self._passed.append(f"{stage} after {after_s:.1f} s")

    def _say(self, text: str) -> None:
        self.shown = readable(" ".join(text.split()))[:LONGEST]


def _text_of(entry: Entry) -> str:
    """Who has pressed, and the result."""
    who = entry["who"] or entry["browser"] or entry["address"]
    return f"{entry['outcome']}, by {who}: {entry['reason']}"


def _pressed_at(entry: Entry) -> float:
    return datetime.fromisoformat(entry["pressed_at"] or entry["at"]).timestamp()

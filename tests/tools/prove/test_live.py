"""The live proof at a pseudo terminal: a panel that is served, its robot, a person who watches."""

import json
import signal
from collections.abc import Iterator
from contextlib import ExitStack
from copy import copy
from dataclasses import dataclass
from pathlib import Path

import pytest

from app.panel import Panel, load_panel
from app.panel.robot_panels import panel_of
from app.tools.editor.kiosk_client import KioskClient
from app.tools.prove.cases import alarm_key, plan_of
from app.tools.prove.measures import Measure
from app.tools.prove.proof import _Round
from app.tools.prove.report import canonical
from app.tools.prove.rig import Rig
from app.tools.prove.robot import ProvingRobots
from app.tools.prove.shown import Event, Shown
from app.tools.prove.steps import Row, steps_of
from app.tools.prove.watch import PanelWatch
from tests.support.holds import TRIES
from tests.tools.prove.person import Person
from tests.tools.prove.test_prove import PANEL, ROBOTS

HORN = """
title = "Cell"
[[page]]
id = "main"
title = "Main"
[[page.widget]]
id = "horn"
kind = "publish"
label = "Horn"
topic = "/horn"
type = "std_msgs/msg/Empty"
message = {}
"""


@pytest.fixture
def people() -> Iterator[ExitStack]:
    with ExitStack() as stack:
        yield stack


@pytest.fixture
def horn(tmp_path: Path) -> Path:
    path = tmp_path / "cell.toml"
    path.write_text(HORN)
    return path


@pytest.fixture
def rig(horn: Path, tmp_path: Path) -> Iterator[Rig]:
    panel = load_panel(horn)
    with Rig(panel, ProvingRobots(panel, ""), tmp_path / "data") as running:
        yield running


def sit(people: ExitStack, panel: Path, rig: Rig, *options: str, by: str = "M. Sato") -> Person:
    person = Person(panel, f"http://127.0.0.1:{rig.port}", *options, by=by)
    people.callback(person.close)
    return person


@dataclass
class Beside(Rig):
    """Another client of the server of a rig, with a robot of it."""

    host: Rig | None = None

    def _start_server(self) -> None:
        assert self.host is not None
        self.port, self._simulators = self.host.port, self.host._simulators
        self._simulating, self._made = self.host._simulating, self.host._made


def press(rig: Rig, control: str) -> None:
    """As an operator, who presses again where the state has just changed: between the end of a
    publisher and the token of the next its last value counts."""
    is_free, tries = rig.await_free(control, 20), TRIES
    while (outcome := rig.press(control, {})[1]["outcome"]) == "refused" and tries:
        is_free, tries = rig.await_free(control, 20, refused=True), tries - 1
    assert (is_free, outcome) == (True, "published")


class Operator:
    """Does at the machine what a step asks for."""

    def __init__(
        self, panel: Panel, folder: Path, robot: str = "", beside: "Operator | None" = None
    ) -> None:
        """`robot` is the id of one of several, whose server is that of the operator `beside` this."""
        own = panel_of(panel, robot or None)
        self.plan = plan_of(own, robot)
        self.steps = {step.title: step for step in steps_of(own, self.plan, has_users=False)}
        self.at = _Round(panel, robot, self.plan, folder=folder, tell=lambda _: None, looks=False)
        if beside is not None:
            robots = copy(beside.robots)
            robots.name, robots.own = robot, robots[robot]
            self.at._robots, self.at._robot = robots, robots.own
            self.at._rig = Beside(panel, robots, folder, host=beside.rig)
        self.rig: Rig = self.at._rig
        self.robots: ProvingRobots = self.at._robots
        self.lost = ""

    def does(self, title: str, person: Person) -> None:
        kind, *names = self.steps[title].key.split("/")
        interlocks = [*self.plan.interlocks.values()]
        self.restores()
        self.robots.permit(interlocks, {*self.plan.interlocks})
        for each in interlocks:  # the step before may have announced it otherwise
            self.rig.announce(each)
        if kind == "interlock":
            self._changes(names[0], names[1], person)
        elif kind == "press":
            press(self.rig, names[0])
        elif kind == "hold":
            assert self.rig.await_free(names[0], 20)
            guard = self.plan.interlocks.get(names[2])
            self.at._hold(self.plan.controls[names[0]], names[1], guard)  # type: ignore[arg-type]
        elif kind == "alarm":
            self._raises(names[0])
        elif names[0] == "link_cut":
            person.hears("the link is up")
            self.cuts(self.robots.name)

    def cuts(self, robot: str) -> None:
        self.lost = robot or "the only one"
        self.rig.cut(robot)

    def restores(self) -> None:
        """What was cut is there again."""
        if self.lost:
            self.rig.join_again(self.lost if self.robots.name else "")
            self.lost = ""

    def _changes(self, guard: str, situation: str, person: Person) -> None:
        interlock = self.plan.interlocks[guard]
        if situation == "permits":
            return
        person.hears(f'"{interlock.label}" permits')
        if situation == "forbids":
            self.robots.forbid(interlock, {*self.plan.interlocks})
        elif situation == "old":
            self.robots.silence([interlock])
        elif situation == "robot_lost":
            self.cuts(self.robots.name_for(interlock))
        else:
            gone = situation == "publisher_gone"
            self.rig.announce(interlock, "std_msgs/msg/Int8", gone=gone)

    def _raises(self, name: str) -> None:
        alarm = next(each for each in self.plan.alarms if each.id == name)
        self.robots.own.set_alarm(alarm, raised=True)
        shown, key = self.rig.shown, alarm_key(name, self.robots.name)
        assert shown.wait(lambda: shown.alarm(key).get("state") == "active", 20) is not None
        assert self.rig.acknowledge(key, shown.alarm(key)["occurrence"])[0] == 200
        self.robots.own.set_alarm(alarm, raised=False)


def test_a_person_goes_through_all_steps(tmp_path: Path, people: ExitStack) -> None:
    path, page = tmp_path / "cell.toml", tmp_path / "proof.html"
    path.write_text(PANEL)
    operator = Operator(load_panel(path), tmp_path / "machine")
    with operator.rig:
        options = ("--report", str(page), "--sign", "--data", str(tmp_path / "key"), "--json")
        person = sit(people, path, operator.rig, *options)
        seen = []
        while title := person.step():
            seen.append(title)
            step = operator.steps[title]
            if step.key.endswith("never_seen"):
                person.types("s")
                person.hears("Why not: ")
                person.types("not on a Monday\n")
                person.hears("kept: skip\n")
                continue
            operator.does(title, person)
            person.sees([row.name for row in step.rows])
            person.ticks()
        assert person.ends() == 0, person.said
    assert seen == [*operator.steps]
    report = json.loads(person.said[person.said.index("{\n") :])
    assert (report["kind"], report["holds"], report["watched_by"]) == ("live", True, ["M. Sato"])
    assert report["left_out"]["interlock/guard/never_seen"] == "skipped by M. Sato: not on a Monday"
    rows = {(row["name"], row["guard"], row["situation"]): row for row in report["results"]}
    assert "Guard door" in rows["start", "guard", "forbids"]["shown"]
    assert rows["horn", "", "permits"]["shown"].startswith("published, by the panel at the cell")
    assert rows["hot", "", "raised"]["shown"].startswith("raised after ")
    assert all(row["by"] and row["at"] and row["took_s"] is not None for row in report["results"])
    text = page.read_text()
    assert "M. Sato" in text
    assert "not on a Monday" in text
    assert report["signature"]
    assert b"M. Sato" in canonical(report)


def test_each_of_two_robots_is_proved_where_control_is_required(
    tmp_path: Path, people: ExitStack
) -> None:
    """The watcher has no control: to it each control is locked all the time."""
    path = tmp_path / "cell.toml"
    path.write_text(ROBOTS)
    panel = load_panel(path)
    left = Operator(panel, tmp_path / "machine", "left")
    right = Operator(panel, tmp_path / "beside", "right", left)
    with left.rig, right.rig:
        person = sit(people, path, left.rig, "--json")
        seen = []
        while title := person.step():
            operator = {"left": left, "right": right}[person.robot]
            seen.append((person.robot, title))
            step = operator.steps[title]
            if step.key.endswith("never_seen"):
                person.types("snot on a Monday\n")
                continue
            left.restores()
            operator.does(title, person)
            person.sees([row.name for row in step.rows])
            person.ticks()
        assert person.ends() == 0, person.said
    assert seen == [("left", title) for title in left.steps] + [
        ("right", title) for title in right.steps
    ]
    report = json.loads(person.said[person.said.index("{\n") :])
    rows = {
        (row["robot"], row["name"], row["guard"], row["situation"]): row for row in report["results"]
    }
    forbids = rows["right", "weld", "door", "forbids"]["shown"]
    assert "Door not met" in forbids
    assert "Left is out of the way" not in forbids  # it permits
    lost = rows["right", "weld", "left_clear", "robot_lost"]["shown"]
    assert "Left is out of the way not known" in lost
    assert "No connection" in rows["right", "weld", "", "link_cut"]["shown"]


def measured(panel: Panel, situation: str, guard: str) -> tuple[Measure, Shown]:
    """Of the control weld, and what its server shows: everything permits."""
    watch = PanelWatch(KioskClient("http://127.0.0.1", None), "right")
    watch.lost = ""
    watch.shown.take(Event("link", {"bridge": {"state": "ok"}}, ""))
    watch.shown.take(Event(f"{guard}-enabled-updated", {"enabled": True}, ""))
    measure = Measure(Row("control", "weld", guard, situation), panel, watch)
    measure.look()
    return measure, watch.shown


def locks(shown: Shown, measure: Measure, reasons: str) -> bool:
    """Whether a lock with this reason is what the step waits for."""
    shown.take(Event("update", {"weld": {"enabled": False, "reasons": reasons}}, ""))
    measure.look()
    return measure.took_s is not None


def test_a_lost_robot_and_a_cut_link_are_shown_by_reasons_that_say_so(tmp_path: Path) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(ROBOTS.replace('"Left"', '"Welder"').replace("control = {", "# control = {"))
    panel = load_panel(path)
    lost, shown = measured(panel, "robot_lost", "left_clear")
    shown.take(Event("left_clear-enabled-updated", {"enabled": False}, ""))
    assert not locks(shown, lost, "The robot does not permit Left is out of the way.")
    assert locks(shown, lost, "Welder: No connection to the robot.")
    cut, shown = measured(panel, "link_cut", "")
    assert not locks(shown, cut, "The robot does not permit Door.")
    shown.take(Event("link", {"bridge": {"state": "lost"}}, ""))
    assert not locks(shown, cut, "The robot does not permit Door.")
    assert locks(shown, cut, "No connection to the robot.")


def finish(person: Person, rig: Rig) -> int:
    """The steps of the panel with a horn, from the press on."""
    press(rig, "horn")
    person.sees(["horn"])
    person.ticks()
    person.step()
    person.hears("the link is up")
    rig.cut()
    person.sees(["horn"])
    person.ticks()
    assert person.step() == ""
    return person.ends()


def test_it_is_interrupted_three_times_and_goes_on(horn: Path, rig: Rig, people: ExitStack) -> None:
    first = sit(people, horn, rig)
    first.step()
    press(rig, "horn")
    first.sees(["horn"])
    first.types("rsaw it move\n")
    first.ticks()
    first.step()
    first.types("q")
    first.hears("The same command continues")
    assert first.ends() == 3
    second = sit(people, horn, rig, by="A. Weber")
    second.hears("1 of 2 steps are done.")
    second.step()
    assert second.ends(signal.SIGINT) == 3
    third = sit(people, horn, rig)
    third.step()
    third.ends(signal.SIGKILL)
    last = sit(people, horn, rig, "--json", by="A. Weber")
    assert last.step() == "the link to the robot is cut"
    last.hears("the link is up")
    rig.cut()
    last.sees(["horn"])
    last.ticks()
    assert last.ends() == 0
    report = json.loads(last.said[last.said.index("{\n") :])
    assert report["watched_by"] == ["M. Sato", "A. Weber"]
    assert [row["remark"] for row in report["results"]] == ["saw it move", ""]


def test_a_step_before_is_answered_again_and_a_cross_does_not_hold(
    horn: Path, rig: Rig, people: ExitStack
) -> None:
    person = sit(people, horn, rig)
    person.step()
    person.types("t")
    person.hears("The panel has not shown it: horn")
    person.types("t")
    person.hears("kept: tick, with 1 faults")
    person.step()
    person.types("b")
    person.step()
    press(rig, "horn")
    person.sees(["horn"])
    person.types("xnobody heard it\n")
    person.hears("kept: cross, with 1 faults")
    person.step()
    person.types("sno cable here\n")
    person.hears("kept: skip")
    assert person.ends() == 1
    assert "crossed: nobody heard it" in person.said


def test_another_panel_file_begins_again(horn: Path, rig: Rig, people: ExitStack) -> None:
    first = sit(people, horn, rig)
    first.step()
    first.types("sno horn yet\n")
    first.hears("kept: skip")
    first.types("q")
    first.ends()
    horn.write_text(HORN.replace('"Horn"', '"Whistle"'))
    other = sit(people, horn, rig)
    assert other.ends() == 2
    assert "the server shows another panel file" in other.said
    panel = load_panel(horn)
    with Rig(panel, ProvingRobots(panel, ""), horn.parent / "other") as changed:
        person = sit(people, horn, changed)
        person.hears("each case begins again")
        assert person.step() == 'control horn ("Whistle"), press'
        assert finish(person, changed) == 0
    aside = [*horn.parent.glob("cell.proof-live.json.*")]
    assert ["no horn yet" in path.read_text() for path in aside] == [True]


def test_a_panel_file_that_changes_under_a_step_ends_it(
    horn: Path, people: ExitStack, tmp_path: Path
) -> None:
    panel = load_panel(horn)
    with Rig(panel, ProvingRobots(panel, ""), tmp_path / "data") as rig:
        person = sit(people, horn, rig)
        person.step()
    changed = tmp_path / "changed.toml"
    changed.write_text(HORN.replace('"Horn"', '"Whistle"'))
    other = load_panel(changed)
    with Rig(other, ProvingRobots(other, ""), tmp_path / "data", port=rig.port):
        assert person.ends() == 2
    assert f"shows another panel file now ({other.revision}" in person.said


def test_two_persons_and_a_lost_server(horn: Path, people: ExitStack, tmp_path: Path) -> None:
    panel = load_panel(horn)
    with Rig(panel, ProvingRobots(panel, ""), tmp_path / "data") as rig:
        first = sit(people, horn, rig)
        first.step()
        second = sit(people, horn, rig, by="A. Weber")
        assert second.ends() == 2
        assert "this proof runs at another terminal" in second.said
    first.hears("server: ")
    first.types("t")
    first.hears("Not now: the panel's server can't be read")
    with Rig(panel, ProvingRobots(panel, ""), tmp_path / "data", port=rig.port) as again:
        first.hears("it answers again")
        assert finish(first, again) == 0
    gone = sit(people, horn, rig)
    assert gone.ends() == 2
    assert "127.0.0.1" in gone.said


def test_without_an_engineers_token_it_says_so(horn: Path, people: ExitStack, tmp_path: Path) -> None:
    from tests.support.users import add_user, token_of

    panel, data = load_panel(horn), tmp_path / "data"
    data.mkdir(mode=0o700)
    add_user(data, "M. Sato", "engineer", pin="2580")
    token = tmp_path / "token"
    token.write_text(token_of(data, "proof", "engineer"))
    with Rig(panel, ProvingRobots(panel, ""), data) as rig:
        without = sit(people, horn, rig)
        assert without.ends() == 2
        assert "an engineer's token is needed" in without.said
        person = sit(people, horn, rig, "--token-file", str(token))
        person.step()
        person.types("sonly what has no role is asked here\n")
        assert person.step() == "without a role"
        person.sees(["horn"])
        person.types("q")
        assert person.ends() == 3

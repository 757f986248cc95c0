"""The live proof at a pseudo terminal: a panel that is served, its robot, a person who watches."""

import json
import signal
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from app.panel import Panel, load_panel
from app.tools.prove.cases import plan_of
from app.tools.prove.proof import _Round
from app.tools.prove.report import canonical
from app.tools.prove.rig import Rig
from app.tools.prove.robot import ProvingRobots
from app.tools.prove.steps import steps_of
from tests.support.holds import TRIES
from tests.tools.prove.person import Person
from tests.tools.prove.test_prove import PANEL

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


class Operator:
    """Does at the machine what a step asks for."""

    def __init__(self, panel: Panel, folder: Path) -> None:
        self.plan = plan_of(panel)
        self.steps = {step.title: step for step in steps_of(panel, self.plan, has_users=False)}
        self.at = _Round(panel, "", self.plan, folder=folder, tell=lambda _: None, looks=False)
        self.rig, self.robot = self.at._rig, self.at._robot

    def does(self, title: str, person: Person) -> None:
        kind, *names = self.steps[title].key.split("/")
        interlocks = [*self.plan.interlocks.values()]
        self.robot.permit(interlocks, {*self.plan.interlocks})
        for each in interlocks:  # the step before may have announced it otherwise
            self.rig.announce(each)
        if kind == "interlock":
            self._changes(names[0], names[1], person)
        elif kind == "press":
            assert self.presses(names[0]) == "published"
        elif kind == "hold":
            self.free(names[0])
            guard = self.plan.interlocks.get(names[2])
            self.at._hold(self.plan.controls[names[0]], names[1], guard)  # type: ignore[arg-type]
        elif kind == "alarm":
            self._raises(names[0])
        else:
            person.hears("the link is up")
            self.rig.cut()

    def presses(self, control: str) -> str:
        """The outcome; again where the state has just changed: between the end of a publisher and the
        token of the next its last value counts."""
        outcome = ""
        for _ in range(TRIES):
            self.free(control)
            outcome = self.rig.press(control, {})[1]["outcome"]
            if outcome != "refused":
                break
        return outcome

    def free(self, control: str) -> None:
        assert self.rig.shown.wait(lambda: not self.rig.shown.is_locked(control), 20) is not None

    def _changes(self, guard: str, situation: str, person: Person) -> None:
        interlock = self.plan.interlocks[guard]
        if situation == "permits":
            return
        person.hears(f'"{interlock.label}" permits')
        if situation == "forbids":
            self.robot.forbid(interlock, {*self.plan.interlocks})
        elif situation == "old":
            self.robot.silence([interlock.topic])
        else:
            gone = situation == "publisher_gone"
            self.rig.announce(interlock, "std_msgs/msg/Int8", gone=gone)

    def _raises(self, name: str) -> None:
        alarm = next(each for each in self.plan.alarms if each.id == name)
        self.robot.set_alarm(alarm, raised=True)
        shown = self.rig.shown
        assert shown.wait(lambda: shown.alarm(name).get("state") == "active", 20) is not None
        body = {"occurrence": shown.alarm(name)["occurrence"]}
        assert self.rig.request("POST", f"/alarms/{name}/acknowledge", body)[0] == 200
        self.robot.set_alarm(alarm, raised=False)


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


def finish(person: Person, rig: Rig) -> int:
    """The steps of the panel with a horn, from the press on."""
    assert rig.press("horn", {})[1]["outcome"] == "published"
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
    assert rig.press("horn", {})[1]["outcome"] == "published"
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
    assert rig.press("horn", {})[1]["outcome"] == "published"
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

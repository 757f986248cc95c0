"""The proof of a panel: it holds for the code as it is, and not for code that decides wrongly."""

import json
import math
from pathlib import Path
from typing import Any

import pytest

from app.cell.alarms import sources
from app.cell.commands import alarm_acts, holds, presses
from app.cell.commands.judge import PressJudge
from app.cell.people import access, confirmer
from app.cell.people.access import USER
from app.cell.permission import conditions, interlocks, press_permission
from app.cell.permission.verdict import PERMITTED, Verdict
from app.panel import Panel, load_panel
from app.tools.cli.prove import main
from app.tools.prove import proof as proving
from app.tools.prove.cases import plan_of
from app.tools.prove.proof import AGAIN, TRIES, _Round, is_held, prove
from app.tools.prove.result import Proof, Result
from app.tools.prove.rig import HOLDER, Rig
from app.tools.prove.robot import ProvingRobots
from app.tools.prove.steps import steps_of

PANEL = """
title = "Cell"
language = "en"
[[interlock]]
id = "guard"
label = "Guard door"
topic = "/guard"
max_age_s = 0.6
require_publisher = true
[[interlock]]
id = "mode"
label = "Automatic"
topic = "/mode"
type = "std_msgs/msg/String"
equals = "AUTO"
[[page]]
id = "main"
title = "Main"
[[page.widget]]
id = "start"
kind = "publish"
label = "Start"
topic = "/start"
type = "std_msgs/msg/Empty"
message = {}
interlock = ["guard", "mode"]
[[page.widget]]
id = "jog"
kind = "hold"
label = "Jog"
topic = "/jog"
type = "std_msgs/msg/Float64"
message = { data = 1.0 }
release = { data = 0.0 }
interlock = "guard"
[[page.widget]]
id = "horn"
kind = "publish"
label = "Horn"
topic = "/horn"
type = "std_msgs/msg/Empty"
message = {}
[[alarm]]
id = "hot"
topic = "/temperature"
type = "std_msgs/msg/Float64"
text = "Too hot"
high = 80.0
"""


@pytest.fixture(scope="module")
def panel(tmp_path_factory: pytest.TempPathFactory) -> Panel:
    path = tmp_path_factory.mktemp("panel") / "cell.toml"
    path.write_text(PANEL)
    return load_panel(path)


def proved(panel: Panel) -> Proof:
    return prove(panel, with_browser=False)


@pytest.fixture(scope="module")
def whole(panel: Panel) -> Proof:
    return proved(panel)


def test_every_case_holds_and_none_is_left_out(panel: Panel, whole: Proof) -> None:
    assert [tuple(result) for result in whole.faults] == []
    assert whole.left_out == {}
    tried = {(row.name, row.guard, row.situation) for row in whole.results}
    plan = plan_of(panel)
    assert {tuple(case) for case in plan.cases()} <= tried
    assert {(case.control, case.guard, case.end) for case in plan.holds()} <= tried
    of_all = {("start", "", situation) for situation in ("link_cut", "shutdown", "no_role")}
    assert of_all | {("hot", "", "raised")} <= tried


def test_what_the_page_says_names_the_interlock_and_times_are_measured(whole: Proof) -> None:
    rows = {(row.name, row.guard, row.situation): row for row in whole.results}
    assert "Guard door" in rows["start", "guard", "forbids"].shown
    old = rows["start", "guard", "old"].took_s
    assert old is not None
    assert 0.3 < old < 3.0
    assert rows["jog", "", "released"].took_s is not None


def always(value: Any) -> Any:
    return lambda *_, **__: value


@pytest.mark.parametrize(("where", "name", "control", "at_first"), [
    ("_rig", "press", "horn", (409, {"outcome": "refused", "reason": "Just changed."})),
    ("", "_begin", "jog", {"state": "ended", "outcome": "refused", "reason": "Just changed."}),
    ("", "_beat", "jog", {"state": "ended", "code": "hold_by_heartbeat", "reason": "No signal."}),
])  # fmt: skip
def test_a_press_that_is_refused_at_first_or_a_hold_that_ends_by_itself_is_tried_again(
    panel: Panel,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    where: str,
    name: str,
    control: str,
    at_first: Any,
) -> None:
    plan = plan_of(panel)
    proving = _Round(panel, "", plan, folder=tmp_path, tell=lambda _: None, looks=False)
    owner = getattr(proving, where) if where else proving
    does, times, is_refused_always = getattr(owner, name), 0, False

    def changed(*arguments: Any) -> Any:
        nonlocal times
        times += 1
        return at_first if times == 1 or is_refused_always else does(*arguments)

    guarded = plan.controls[control]
    monkeypatch.setattr(owner, name, changed)
    with proving._rig:
        proving._permit_for(guarded, [*plan.interlocks.values()])
        assert proving._arrives(guarded) == ""
        is_refused_always, times = True, 0
        assert proving._arrives(guarded).startswith(AGAIN)
    assert times == TRIES


def test_a_hold_that_ends_by_late_beats_before_its_interlock_forbids_is_tried_again(
    panel: Panel, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plan, results = plan_of(panel), list[Result]()
    proving = _Round(panel, "", plan, folder=tmp_path, tell=results.append, looks=False)
    beat, times, begin, began = proving._beat, 0, proving._begin, list[bool]()

    def late(*arguments: Any) -> dict[str, Any]:
        nonlocal times
        times += 1
        end = {"code": "hold_by_heartbeat", "reason": "No signal."}
        return end if times == 2 else beat(*arguments)

    def counted(*arguments: Any) -> dict[str, Any]:
        began.append(is_held(answer := begin(*arguments)))
        return answer

    monkeypatch.setattr(proving, "_begin", counted)
    monkeypatch.setattr(proving, "_beat", late)
    with proving._rig:
        proving._permit_for(plan.controls["jog"], [*plan.interlocks.values()])
        proving._hold(plan.controls["jog"], "forbids", plan.interlocks["guard"])
    assert [(row.situation, row.fault) for row in results] == [("forbids", "")]
    assert began.count(True) >= 2


# Code that decides wrongly: (module or class, name, in its place).
MUTANTS: dict[str, tuple[Any, str, Any]] = {
    "a value that does not permit counts as one that does": (conditions, "permits", lambda *_: True),
    "values do not get old": (conditions, "stale_at", lambda *_: math.inf),
    "presses go on at the end of the server": (presses.Presses, "close", lambda _: None),
    "another type is read": (interlocks, "topic_mismatch", always(None)),
    "a topic that was never received permits": (conditions, "unread", always(PERMITTED)),
    "the reason says nothing": (conditions, "refusal", always(Verdict(False, "x", "Locked."))),
    "a press is not judged by interlocks": (press_permission, "interlock_verdict", always(PERMITTED)),
    "a press is not judged": (PressJudge, "verdict", always(PERMITTED)),
    "a hold is judged at its begin only": (holds.HoldController, "judge", lambda _: None),
    "a lease does not end": (holds.Lease, "end_code", always("")),
    "a closed page holds on": (holds, "LEASE_S", 60.0),
}


@pytest.mark.long("table")
@pytest.mark.parametrize("mutant", MUTANTS)
def test_wrong_code_does_not_hold(panel: Panel, monkeypatch: pytest.MonkeyPatch, mutant: str) -> None:
    where, name, instead = MUTANTS[mutant]
    monkeypatch.setattr(where, name, instead)
    assert proved(panel).faults


CONFIRMED = """
title = "Oven"
language = "en"
access = { groups = ["quality"] }
[[page]]
id = "main"
title = "Main"
[[page.widget]]
id = "heat"
kind = "publish"
label = "Heat"
topic = "/heat"
type = "std_msgs/msg/Empty"
message = {}
confirm_press = "pin"
[[page.widget]]
id = "bypass"
kind = "publish"
label = "Bypass"
topic = "/bypass"
type = "std_msgs/msg/Empty"
message = {}
needs = "maintenance"
confirm_press = "two_persons"
[[page.widget]]
id = "approve"
kind = "publish"
label = "Approve"
topic = "/approve"
type = "std_msgs/msg/Empty"
message = {}
needs = "quality"
[[page.widget]]
id = "jog"
kind = "hold"
label = "Jog"
topic = "/jog"
type = "std_msgs/msg/Float64"
message = { data = 1.0 }
release = { data = 0.0 }
interlock = "door"
confirm_press = "pin"
[[interlock]]
id = "door"
label = "Door"
topic = "/door"
[[alarm]]
id = "hot"
text = "Too hot"
topic = "/oven"
type = "std_msgs/msg/Float64"
high = 80.0
confirm_act = "pin"
[[alarm]]
id = "smoke"
topic = "/faults"
type = "diagnostic_msgs/msg/DiagnosticArray"
list = { field = "status", code = "name", text = "message", level = "level" }
confirm_act = "two_persons"
"""
CONFIRMATIONS = {
    ("hot", "unconfirmed"), ("hot", "wrong_pin"), ("hot", "raised"),
    ("smoke", "unconfirmed"), ("smoke", "wrong_pin"), ("smoke", "same_person"), ("smoke", "raised"),
    ("heat", "unconfirmed"), ("heat", "wrong_pin"),
    ("bypass", "unconfirmed"), ("bypass", "wrong_pin"), ("bypass", "same_person"),
    ("jog", "unconfirmed"), ("jog", "wrong_pin"),
}  # fmt: skip


@pytest.fixture(scope="module")
def oven(tmp_path_factory: pytest.TempPathFactory) -> Panel:
    path = tmp_path_factory.mktemp("oven") / "oven.toml"
    path.write_text(CONFIRMED)
    return load_panel(path)


def test_roles_and_confirmations_are_tried_by_users_of_the_proof(oven: Panel) -> None:
    proof = proved(oven)
    assert [tuple(result) for result in proof.faults] == []
    assert proof.left_out == {}
    tried = {(row.name, row.situation) for row in proof.results}
    assert tried >= CONFIRMATIONS
    for control in ("heat", "bypass", "approve", "jog"):
        assert {(control, "role_enough"), (control, "role_less"), (control, "no_role")} <= tried
        assert (control, "permits") in tried
    assert {row.shown for row in proof.results if row.situation == "role_enough"} == {""}


def test_wrong_pins_delay_nothing_that_is_tried_next(oven: Panel, tmp_path: Path) -> None:
    with Rig(oven, ProvingRobots(oven, ""), tmp_path / "data", users=[HOLDER]) as rig:
        for _ in range(USER.free + 1):
            assert rig.confirm("heat", {}, "pin", "wrong_pin") == ""
        assert rig.confirm("heat", {}, "pin")


# The same for roles and confirmations.
OPEN_TO_ALL: dict[str, tuple[Any, str, Any]] = {
    "a role is not judged": (press_permission, "role_verdict", always(None)),
    "a press needs no confirmation": (press_permission, "unconfirmed", always(None)),
    "an act on an alarm needs no confirmation": (alarm_acts, "unconfirmed", always(None)),
    "any PIN is right": (access, "matches", always(True)),
    "one person is two": (confirmer, "_same_person", always(None)),
}


@pytest.mark.long("table")
@pytest.mark.parametrize("mutant", OPEN_TO_ALL)
def test_who_may_press_does_not_hold_with_wrong_code(
    oven: Panel, monkeypatch: pytest.MonkeyPatch, mutant: str
) -> None:
    where, name, instead = OPEN_TO_ALL[mutant]
    monkeypatch.setattr(where, name, instead)
    assert proved(oven).faults


ALARMS = """
title = "Cell"
language = "en"
[[page]]
id = "main"
title = "Main"
[[page.widget]]
id = "speed"
kind = "number"
label = "Speed"
min = 0
max = 10
default = 5
[[page.widget]]
id = "height"
kind = "number"
label = "Height"
min = 0
max = 10
default = 5
[[interlock]]
id = "ready"
label = "Ready"
topic = "/ready"
[[recipe]]
id = "boxes"
label = "Boxes"
fields = ["speed", "height"]
topic = "/recipe"
type = "geometry_msgs/msg/Point"
message = { x = "{speed}", y = "{height}", z = 0 }
interlock = "ready"
[recipe.readback]
topic = "/loaded"
type = "geometry_msgs/msg/Point"
fields = { speed = "x", height = "y" }
[[alarm]]
id = "silent"
text = "Silent"
topic = "/beat"
type = "std_msgs/msg/Bool"
stale_s = 1.5
[[alarm]]
id = "gone"
text = "The controller is gone"
node = "/controller"
[[alarm]]
id = "cut"
text = "No link"
lost = "robot"
[[alarm]]
id = "motors"
diagnostics = "motor *"
[[alarm]]
id = "listed"
topic = "/faults"
type = "diagnostic_msgs/msg/DiagnosticArray"
list = { field = "status", code = "name", text = "message", level = "level" }
[[alarm]]
id = "calm"
text = "Moves in setup"
when = { topic = "/moves", type = "std_msgs/msg/Bool" }
while = { topic = "/service", type = "std_msgs/msg/Bool" }
[[alarm]]
id = "slow"
text = "Slow"
topic = "/slow"
type = "std_msgs/msg/Float64"
high = 1.0
on_delay_s = 600.0
"""


PATIENT = """
title = "Cell"
[[page]]
id = "main"
title = "Main"
[[alarm]]
id = "late"
text = "Late"
topic = "/beat"
type = "std_msgs/msg/Bool"
stale_s = 1.5
on_delay_s = 0.7
off_delay_s = 0.8
"""


def test_recipes_are_loaded_and_alarms_of_each_source_are_raised(tmp_path: Path) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(ALARMS)
    proof = proved(load_panel(path))
    assert [tuple(result) for result in proof.faults] == []
    why = "it takes 600 s, and the proof waits for 30 s at most (--patient)"
    assert proof.left_out == {"alarm slow": why}
    tried = {(row.name, row.guard, row.situation) for row in proof.results}
    assert {
        ("boxes", "ready", situation) for situation in ("permits", "forbids", "never_seen")
    } <= tried
    raised = {row.name for row in proof.results if row.kind == "alarm"}
    assert raised == {"silent", "gone", "cut", "motors", "listed", "calm"}


def test_a_patient_proof_waits_for_an_alarm_as_long_as_it_takes(tmp_path: Path) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(PATIENT)
    panel = load_panel(path)
    plan = plan_of(panel, longest_s=2.9)
    assert [*plan.left_out] == ["alarm late"]
    live = [step.key for step in steps_of(panel, plan, has_users=False)]
    assert live == ["alarm/late"]  # a person waits for it
    proof = prove(panel, with_browser=False, longest_s=3.0)
    assert [(row.name, row.fault) for row in proof.results] == [("late", "")]
    assert proof.results[0].took_s is not None
    assert 2.0 < proof.results[0].took_s < 4.9


@pytest.mark.parametrize(("options", "longest_s"), [((), 30.0), (("--patient",), math.inf)])
def test_the_command_is_patient_if_it_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, options: tuple[str, ...], longest_s: float
) -> None:
    waits: list[float] = []

    def kept(*_: Any, **named: Any) -> Proof:
        waits.append(named["longest_s"])
        return Proof()

    monkeypatch.setattr(proving, "prove", kept)
    path = tmp_path / "cell.toml"
    path.write_text(PATIENT)
    main([str(path), *options])
    assert waits == [longest_s]


@pytest.mark.long("table")
@pytest.mark.parametrize("kind", ["stale", "node", "lost"])
def test_an_alarm_that_is_not_raised_does_not_hold(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kind: str
) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(ALARMS)
    readers: Any = sources.READERS
    monkeypatch.setitem(readers, kind, always(sources.UNKNOWN))
    assert [row.kind for row in proved(load_panel(path)).faults] == ["alarm"]


def test_the_command_reports_and_signs(
    whole: Proof,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(proving, "prove", always(whole))
    path, page = tmp_path / "cell.toml", tmp_path / "proof.html"
    path.write_text(PANEL)
    arguments = [str(path), "--json", "--report", str(page), "--sign", "--data", str(tmp_path / "data")]
    assert main(arguments) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["holds"] is True
    assert len(report["results"]) == report["cases"] > 20
    assert _is_signed(report)
    report["results"][0]["fault"] = "none of it"
    assert not _is_signed(report)
    text = page.read_text()
    assert "Every case holds" in text
    assert report["sha256"] in text


def _is_signed(report: dict[str, Any]) -> bool:
    from base64 import b64decode

    from cryptography.exceptions import InvalidSignature
    from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey

    from app.tools.prove.report import canonical

    key = Ed25519PublicKey.from_public_bytes(b64decode(report["key"]))
    try:
        key.verify(b64decode(report["signature"]), canonical(report))
    except InvalidSignature:
        return False
    return True


def test_a_panel_that_can_not_be_used_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(PANEL.replace('kind = "hold"', 'kind = "hole"'))
    assert main([str(path)]) == 2
    assert "cell.toml" in capsys.readouterr().err


ROBOTS = """
title = "Cell"
language = "en"
control = { required = true }
[[robot]]
id = "left"
name = "Left"
namespace = "/left"
[[robot]]
id = "right"
name = "Right"
namespace = "/right"
[[interlock]]
id = "door"
label = "Door"
topic = "/door"
max_age_s = 0.6
[[interlock]]
id = "left_clear"
label = "Left is out of the way"
topic = "/clear"
robot = "left"
[[page]]
id = "main"
title = "Main"
[[page.widget]]
id = "jog"
kind = "hold"
label = "Jog"
topic = "/jog"
type = "std_msgs/msg/Float64"
message = { data = 1.0 }
release = { data = 0.0 }
interlock = "door"
[[page]]
id = "right_only"
title = "Right"
robot = "right"
[[page.widget]]
id = "weld"
kind = "publish"
label = "Weld"
topic = "/weld"
type = "std_msgs/msg/Empty"
message = {}
interlock = ["door", "left_clear"]
[[alarm]]
id = "hot"
topic = "/temperature"
type = "std_msgs/msg/Float64"
text = "Too hot"
high = 80.0
"""


def test_each_of_several_robots_is_proved_with_the_interlocks_of_others(tmp_path: Path) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(ROBOTS)
    proof = proved(load_panel(path))
    assert [tuple(result) for result in proof.faults] == []
    assert proof.left_out == {}
    rows = {(row.robot, row.name, row.guard, row.situation): row for row in proof.results}
    assert "Left is out of the way" in rows["right", "weld", "left_clear", "forbids"].shown
    assert ("left", "weld", "", "link_cut") not in rows
    assert "Left" in rows["right", "weld", "left_clear", "robot_lost"].shown
    for robot in ("left", "right"):
        assert "Door is older" in rows[robot, "jog", "door", "old"].shown
        assert (robot, "hot", "", "raised") in rows
        assert (robot, "jog", "", "released") in rows

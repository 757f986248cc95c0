"""A recipe of which the node refuses one value: it keeps all old ones, or they are put back."""

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, Final, NamedTuple

import pytest

from app.cell.commands.parameters import ParameterSync
from app.cell.commands.press import PressHandle
from app.cell.commands.recipe_loads import ChosenRecipe, RecipeLoader
from app.cell.commands.services import ServiceCalls
from app.cell.permission.press_permission import judged
from app.cell.recipes.recipe import new_recipe
from app.cell.robot.parameter_state import ParameterState
from app.cell.session.recipes import Recipes
from app.panel import load_panel
from app.panel.widgets.parameter import SERVICES, SET, SET_ATOMICALLY
from app.records.entry import Outcome
from app.ros.dialects import bridge_dialect
from app.system.errors import PressRefused
from app.tools.simulator.parameters import BOOL, DOUBLE, STRING, NodeParameters, Parameter
from tests.cell.recipes.panels import CARTON, PANEL, TRAY
from tests.support.builders import (
    BRIDGE,
    INTERFACES,
    NOW,
    TRAITS,
    FakeTransport,
    robot_there,
)
from tests.support.waiting import when
from tests.support.words import coded, english

NODE: Final = "palletizer"
BEFORE: Final = {"box.length": 0.4, "arm.speed": 80.0, "gripper": "vacuum", "fast": False, "note": "-"}
AFTER: Final = {"box.length": 0.6, "arm.speed": 80.0, "gripper": "fork", "fast": True, "note": "x"}
KINDS: Final = {float: DOUBLE, str: STRING, bool: BOOL}
ATOMICALLY: Final = SET_ATOMICALLY[0]


class Palletizer(FakeTransport):
    """A link to a node that refuses the gripper `fork` if `refuses`, as its descriptor does not say."""

    def __init__(self, *, refuses: bool) -> None:
        declared = {name: Parameter(KINDS[type(value)], value) for name, value in BEFORE.items()}
        self._gripper = declared["gripper"]
        self._gripper.options = ("vacuum",) if refuses else ()
        self._length = declared["box.length"]
        self._node = NodeParameters(f"/{NODE}", declared)
        self.sets: list[str] = []
        self.keeps_length = False  # from its first set on
        self.is_silent = False  # the same
        self.late: list[Callable[[], None]] = []
        self.answers_late = False

    def values(self) -> dict[str, Any]:
        return {name: self._node.value(name, None) for name in BEFORE}

    def query(self, key: str, payload: bytes, timeout_s: float) -> "asyncio.Future[bytes | None]":
        service = key.rpartition("/")[2]
        answer: asyncio.Future[bytes | None] = asyncio.get_running_loop().create_future()
        if self.sets and self.is_silent:
            return answer
        kind = dict((*SERVICES, SET_ATOMICALLY))[service]
        request, response = INTERFACES.service_types(kind)
        fields = self._node.serve(f"/{key}", INTERFACES.decode(request, payload))
        sent = INTERFACES.encode(response, fields)
        if not service.startswith("set_"):
            answer.set_result(sent)
            return answer
        self.sets.append(service)
        self._length.read_only = self.keeps_length
        if self.answers_late:
            self.late.append(lambda: answer.set_result(sent))
        else:
            answer.set_result(sent)
        return answer


class Prepared(NamedTuple):
    fields: dict[str, Any]
    handle: PressHandle


class Loaded(NamedTuple):
    outcome: Outcome
    corrected: list[Outcome]


async def never(*_: object) -> Outcome:
    raise AssertionError("a load by parameters sends no message")


def once() -> Callable[[], None]:
    """A final check that permits the load, and nothing after it: an interlock has locked."""
    checks = iter([True])

    def check() -> None:
        if not next(checks, False):
            raise PressRefused("locked", "interlock")

    return check


def load(
    folder: Path,
    link: Palletizer,
    *,
    atomically: bool,
    panel_text: str = PANEL,
    then: Callable[[list[Outcome]], Awaitable[None]] | None = None,
) -> Loaded:
    """Loads the tray while the carton is loaded; the node has `set_parameters_atomically` or lacks
    it."""
    path = folder / "cell.toml"
    path.write_text(panel_text)
    panel = load_panel(path)
    (widget,) = panel.recipe_loads
    tray = new_recipe("tray", "created", 0.0, "Ann", "Tray", TRAY)
    corrected: list[Outcome] = []

    async def whole() -> Outcome:
        robot = robot_there(panel)
        robot.traits = replace(TRAITS, server_settle_s=0.0, events_settle_s=60.0)
        calls = ServiceCalls(INTERFACES, robot, link, lambda _: None)
        parameters = ParameterSync(panel, INTERFACES, robot, link, calls, lambda: None)
        loader = RecipeLoader(INTERFACES, robot, parameters, Recipes(panel), lambda _: None)
        for name, kind in (*SERVICES, *([SET_ATOMICALLY] if atomically else [])):
            token = bridge_dialect.server_token(BRIDGE, "SS", f"{NODE}/{name}", kind)
            robot.graph.apply_token(token, True)
        parameters.on_graph_change()
        try:
            await when(lambda: len(robot.parameters) == len(BEFORE), "the node is read")
            handle = PressHandle("p1", corrected.append, once())
            outcome = await loader.load(
                widget, Prepared({"value": ChosenRecipe(tray, TRAY)}, handle), never
            )
            shown = robot.command_status[widget.id]
            assert (shown.outcome, shown.text) == (outcome.outcome, outcome.text)
            if then is not None:
                await then(corrected)
            return outcome
        finally:
            await parameters.stop()

    return Loaded(asyncio.run(whole()), corrected)


def test_a_node_that_takes_all_values_gets_them_in_one_request(tmp_path: Path) -> None:
    for atomically in (True, False):
        link = Palletizer(refuses=False)
        outcome = load(tmp_path, link, atomically=atomically).outcome
        assert (outcome.outcome, coded(outcome.text)) == ("confirmed", ("recipe_loaded",))
        assert link.values() == AFTER
        assert link.sets == [ATOMICALLY if atomically else SET[0]]


@pytest.mark.parametrize(
    ("atomically", "code", "sets"),
    [(True, "recipe_kept", [ATOMICALLY]), (False, "recipe_put_back", [SET[0], SET[0]])],
)
def test_a_refused_value_leaves_all_old_ones(
    tmp_path: Path, atomically: bool, code: str, sets: list[str]
) -> None:
    link = Palletizer(refuses=True)
    outcome = load(tmp_path, link, atomically=atomically).outcome
    assert (outcome.outcome, coded(outcome.text)) == ("rejected", (code,))
    assert "gripper" in english(outcome.text).lower()
    assert link.values() == BEFORE
    assert link.sets == sets


def test_what_can_not_be_put_back_is_named(tmp_path: Path) -> None:
    link = Palletizer(refuses=True)
    link.keeps_length = True
    outcome = load(tmp_path, link, atomically=False).outcome
    assert (outcome.outcome, coded(outcome.text)) == ("rejected", ("recipe_partly_loaded",))
    text = english(outcome.text)
    assert "Length 400 mm → 600 mm" in text
    assert "Fast" not in text  # it was put back
    assert link.values() == {**BEFORE, "box.length": 0.6}


def test_a_node_that_falls_silent_after_a_refusal_claims_nothing(tmp_path: Path) -> None:
    link = Palletizer(refuses=True)
    link.is_silent = True
    quick = PANEL.replace("confirm_s = 8.0", "confirm_s = 0.1")
    outcome = load(tmp_path, link, atomically=False, panel_text=quick).outcome
    assert (outcome.outcome, coded(outcome.text)) == ("rejected", ("recipe_refused_unread",))


def test_a_late_refusal_says_that_other_values_may_be_loaded(tmp_path: Path) -> None:
    link = Palletizer(refuses=True)
    link.answers_late = True

    async def then(corrected: list[Outcome]) -> None:
        (late,) = link.late
        late()
        await when(lambda: corrected, "the receipt is corrected")

    quick = PANEL.replace("confirm_s = 8.0", "timeout_s = 0.1")
    outcome, (late,) = load(tmp_path, link, atomically=False, panel_text=quick, then=then)
    assert outcome.outcome == "timed_out"
    assert (late.outcome, coded(late.text)) == ("rejected", ("recipe_others_may_be_loaded",))


@pytest.mark.parametrize(
    ("state", "code"),
    [
        (ParameterState("live", "vacuum", read_only=True), "parameter_read_only"),
        (ParameterState("undeclared"), "parameter_undeclared"),
        (ParameterState("mistyped", robot_type="integer"), "parameter_mistyped"),
        (ParameterState("waiting"), "parameter_waiting"),
    ],
)
def test_a_load_is_locked_while_the_node_would_refuse_it(
    tmp_path: Path, state: ParameterState, code: str
) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(PANEL)
    panel = load_panel(path)
    (widget,) = panel.recipe_loads
    robot = robot_there(panel)
    for name, kind in SERVICES:
        token = bridge_dialect.server_token(BRIDGE, "SS", f"{NODE}/{name}", kind)
        robot.graph.apply_token(token, True)
    for name, parameter in widget.parameters.items():
        value = TRAY[name]
        robot.parameters[parameter.id] = state if name == "gripper" else ParameterState("live", value)
    assert judged(widget, (), robot, NOW).code == code
    robot.parameters[widget.parameters["gripper"].id] = ParameterState("live", CARTON["gripper"])
    assert judged(widget, (), robot, NOW).permitted

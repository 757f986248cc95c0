"""Acts on control authority: one receipt for each id, logged, refused where a press would be."""

import asyncio
from collections.abc import Coroutine
from typing import Any

import pytest

from app.cell.commands.acts import ActContext, ActReceipt, ActRequest, ActRunner
from app.cell.commands.control_acts import CONTROL_ACTS, TOO_OFTEN, log_hand_over
from app.cell.commands.judge import PressGuard
from app.cell.permission.control import LIFE_S, ControlAuthority
from app.cell.view.publisher import ViewPublisher
from app.cell.view.view import build_view
from app.panel.rules import ControlRules
from app.records import Entry, NullLog
from app.records.press_record import PressLog
from app.records.principal import Clients, Principal, anonymous
from app.system.errors import NotFound
from tests.support.builders import NOW, robot_there, small_panel

_KNOWN = Clients()
ANN, BOB = (Principal(_KNOWN.identify(f"{n:032x}", f"192.0.2.{n}")) for n in (1, 2))
PANEL = small_panel()


class Kept(NullLog):
    """A log that keeps its entries; it may be full, and may be locked."""

    def __init__(self) -> None:
        super().__init__()
        self.entries: list[Entry] = []
        self.full = False
        self.doubt = ""
        self.left_out_of: list[str] = []

    def allowed(self, origin: Any) -> bool:
        return not self.full

    def suppress(self, origin: Any, limited: bool = False) -> None:
        self.left_out_of.append(origin.browser)

    async def closed(self, entry: Entry) -> str:
        self.entries.append(entry)
        await asyncio.sleep(0)
        return self.doubt

    def add(self, entry: Entry) -> None:
        self.entries.append(entry)


class Bench:
    """The acts on one robot, at a time that is set."""

    def __init__(self) -> None:
        self.now = NOW
        self.log = Kept()
        self.shown = 0
        self.control = ControlAuthority(
            ControlRules(required=True),
            "Robot 1",
            monotonic=lambda: self.now,
            on_hand_over=lambda hand_over: log_hand_over(self.press_log, hand_over),
        )
        publisher = ViewPublisher(build_view(PANEL, robot_there(PANEL), NOW).view, "r1")
        self.guard = PressGuard(publisher, self.control, self.log, 3.0, lambda: ())
        self.press_log = PressLog(self.log, "Robot 1")
        context = ActContext(self.guard, self.press_log, "", self._show)
        self.acts = ActRunner("control", CONTROL_ACTS, self.control, context)

    def _show(self) -> None:
        self.shown += 1

    async def do(
        self, act: str, who: Principal = ANN, act_id: str = "a1", to: str = "", at: float | None = None
    ) -> ActReceipt:
        return await self.acts.act(ActRequest(act, who, to, at=at), act_id)

    @property
    def logged(self) -> list[tuple[str, str, str, str]]:
        """Action, who, outcome and reason of each entry."""
        assert all(entry.kind == "control" and entry.robot == "Robot 1" for entry in self.log.entries)
        return [
            (entry.action, entry.browser, entry.outcome, entry.reason) for entry in self.log.entries
        ]


@pytest.fixture
def bench() -> Bench:
    return Bench()


def run(work: Coroutine[Any, Any, None]) -> None:
    asyncio.run(work)


def test_each_control_act_is_a_log_entry_with_its_client(bench: Bench) -> None:
    ann, bob = ANN.client.id, BOB.client.id

    async def work() -> None:
        assert (await bench.do("take", ANN, "a1")).outcome == "succeeded"
        assert (await bench.do("take", BOB, "a2")).outcome == "refused"
        assert (await bench.do("ask", BOB, "a3")).outcome == "accepted"
        assert (await bench.do("keep", ANN, "a4", to=bob)).done
        bench.now += 11
        bench.control.keepalive(BOB, touched=False)
        assert (await bench.do("take", ANN, "a5")).done
        assert (await bench.do("ask", BOB, "a6")).done
        assert (await bench.do("give", ANN, "a7", to=bob)).done
        assert (await bench.do("release", BOB, "a8")).done

    run(work())
    acts = [(action, who, outcome) for action, who, outcome, _ in bench.logged]
    assert acts == [
        ("control_take", ann, "succeeded"),
        ("control_take", bob, "refused"),
        ("control_ask", bob, "accepted"),
        ("control_keep", ann, "succeeded"),
        ("control_lost", ann, ""),
        ("control_take", ann, "succeeded"),
        ("control_ask", bob, "accepted"),
        ("control_give", ann, "succeeded"),
        ("control_release", bob, "succeeded"),
    ]
    assert [entry.press for entry in bench.log.entries][:3] == ["a1", "a2", "a3"]
    assert bench.logged[2][3] == f"Control requested from {ANN.title}."
    assert bench.logged[7][3] == f"Control given to {BOB.title}."


def test_the_same_id_is_the_same_act(bench: Bench) -> None:
    async def work() -> None:
        both = await asyncio.gather(bench.do("take"), bench.do("take"))
        assert both[0] is both[1]
        assert (await bench.do("release", act_id="a2")).done
        assert await bench.do("take") is both[0]
        assert bench.control.holder is None  # nothing was done again

    run(work())
    assert [action for action, *_ in bench.logged] == ["control_take", "control_release"]
    assert bench.acts.receipt("a1") == bench.acts.receipt("a1")


@pytest.mark.parametrize(
    "other", [ActRequest("take", BOB), ActRequest("release", ANN), ActRequest("take", ANN, "x")]
)
def test_an_id_of_another_act_is_refused_and_does_nothing(bench: Bench, other: ActRequest) -> None:
    async def work() -> None:
        await bench.do("take")
        receipt = await bench.acts.act(other, "a1")
        assert (receipt.outcome, receipt.code, receipt.cause) == (
            "refused",
            "press_id_reused",
            "interlock",
        )
        assert bench.control.holder == ANN

    run(work())


def test_act_is_refused_for_the_same_reasons_as_a_press(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def work() -> None:
        late = await bench.do("take", at=0.0)
        assert (late.outcome, late.code, late.cause) == ("refused", "late", "interlock")
        monkeypatch.setattr(bench.log, "lock", "The disk is full.")
        locked = await bench.do("take", act_id="a2")
        assert (locked.reason, locked.cause) == ("The disk is full.", "log")
        monkeypatch.setattr(bench.log, "lock", "")
        bench.guard.close()
        assert (await bench.do("take", act_id="a3")).cause == "link"
        assert bench.control.holder is None

    run(work())


def test_giving_up_is_never_refused_for_the_log_or_the_time(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def work() -> None:
        await bench.do("take")
        monkeypatch.setattr(bench.log, "lock", "The disk is full.")
        bench.log.doubt = "no space left on device"
        receipt = await bench.do("release", act_id="a2", at=0.0)
        assert receipt.done
        assert "no space left on device" in str(receipt.reason)
        assert bench.control.holder is None

    run(work())


def test_refused_acts_beyond_the_quota_are_counted_and_applied_acts_are_logged(bench: Bench) -> None:
    async def work() -> None:
        bench.log.full = True
        await bench.do("take", ANN, "a1")
        await bench.do("take", BOB, "a2")

    run(work())
    assert [(action, who) for action, who, *_ in bench.logged] == [("control_take", ANN.client.id)]
    assert bench.log.left_out_of == [BOB.client.id]


def test_change_of_control_by_time_is_logged(bench: Bench) -> None:
    async def work() -> None:
        await bench.do("take", ANN, "a1")
        await bench.do("ask", BOB, "a2")
        bench.now += LIFE_S - 1
        bench.control.keepalive(BOB, touched=False)
        bench.now += 2
        bench.control.advance()
        assert bench.control.holder == BOB

    run(work())
    action, who, _, reason = bench.logged[-1]
    assert (action, who) == ("control_lost", ANN.client.id)
    assert str(BOB.title) in reason


def test_client_without_a_cookie_is_refused_with_a_receipt(bench: Bench) -> None:
    async def work() -> None:
        program = Principal(anonymous("192.0.2.9"))
        receipt = await bench.do("take", program)
        assert (receipt.outcome, receipt.code) == ("refused", "control_no_cookie")
        again = bench.acts.limited(ActRequest("take", program), "a9", TOO_OFTEN)
        assert (again.cause, again.code) == ("limit", "control_too_often")
        assert bench.acts.receipt("a9") is None

    run(work())


def test_there_is_no_other_act(bench: Bench) -> None:
    async def steal() -> None:
        await bench.do("steal")

    with pytest.raises(NotFound, match="there is take, ask, give, keep, release"):
        asyncio.run(steal())

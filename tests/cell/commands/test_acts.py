"""The runner of acts, with a table that has nothing to do with control."""

import asyncio
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import pytest

from app.cell.commands.acts import (
    Act,
    ActContext,
    ActGuard,
    ActReceipt,
    ActRequest,
    ActRunner,
    Applied,
    always,
    server_permits,
)
from app.cell.commands.user_acts import END, USER_ACTS
from app.cell.people.access_log import CHANGES
from app.cell.permission.verdict import PERMITTED, Verdict, locked
from app.panel.roles import ANYBODY, ENGINEER, VIEWER
from app.records import Entry, NullLog
from app.records.entry import Kind
from app.records.press_record import PressLog
from app.records.principal import Clients, Principal
from app.system.errors import NotFound
from app.system.texts import Text, say, sentences
from app.web.pages.log_words import ACTION_WORDS, TABLES

_KNOWN = Clients()
ANN, BOB = (Principal(_KNOWN.identify(f"{n:032x}", f"192.0.2.{n}")) for n in (1, 2))


@dataclass(frozen=True, slots=True, kw_only=True)
class Count(Applied):
    """A counter after an act."""

    number: int = 0


class Counters(dict[str, int]):
    """Counters by their names: the subject."""

    def increase(self, request: ActRequest) -> Count:
        if request.object not in self:
            return Count(say("control_changed"))
        self[request.object] += request.values["by"]
        return Count(number=self[request.object])

    def reset(self, request: ActRequest) -> Count:
        self.clear()
        return Count(waits=True)


def only_ann(guard: ActGuard, request: ActRequest) -> Verdict:
    return server_permits(guard, request) if request.who == ANN else locked("control_no_cookie")


def entry(count: Count) -> Text:
    return say("more_reasons", number=count.number)


ACTS: Final[Mapping[str, Act[Counters, Count]]] = {
    "increase": Act("log_page_control_take", only_ann, Counters.increase, entry),
    "reset": Act("log_page_control_release", always, Counters.reset, entry),
}


class Guard:
    def __init__(self) -> None:
        self.verdict = self.control = PERMITTED

    def act_verdict(self, at: float | None) -> Verdict:
        return self.verdict

    def control_verdict(self, who: Principal) -> Verdict:
        return self.control


class Log(NullLog):
    def __init__(self) -> None:
        super().__init__()
        self.entries: list[Entry] = []

    async def closed(self, entry: Entry) -> str:
        self.entries.append(entry)
        return ""


class Bench:
    def __init__(self) -> None:
        self.counters = Counters(parts=0)
        self.guard = Guard()
        self.log = Log()
        self.changes = 0
        context = ActContext(self.guard, PressLog(self.log, "Robot 1"), "", self._changed)
        self.runner = ActRunner("control", ACTS, self.counters, context)

    def _changed(self) -> None:
        self.changes += 1

    def increase(
        self, act_id: str, who: Principal = ANN, name: str = "parts", by: int = 2
    ) -> ActReceipt:
        return self.run(ActRequest("increase", who, name, {"by": by}), act_id)

    def run(self, request: ActRequest, act_id: str) -> ActReceipt:
        return asyncio.run(self.runner.act(request, act_id))


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_an_act_is_applied_to_its_object_logged_with_its_values_and_answered(bench: Bench) -> None:
    receipt = bench.increase("a1")
    assert (receipt.outcome, receipt.code, receipt.cause) == ("succeeded", "", "")
    assert (bench.counters, bench.changes) == ({"parts": 2}, 1)
    (logged,) = bench.log.entries
    assert (logged.kind, logged.action, logged.press) == ("control", "control_increase", "a1")
    assert (logged.values, logged.outcome, logged.browser) == (
        '{"by": 2}',
        "succeeded",
        ANN.client.id,
    )
    assert logged.reason == str(entry(Count(number=2)))


def test_the_same_id_with_other_values_is_another_act_and_is_refused(bench: Bench) -> None:
    async def work() -> list[ActReceipt]:
        request = ActRequest("increase", ANN, "parts", {"by": 2})
        others: list[dict[str, Any]] = [{}, {"object": "x"}, {"values": {"by": 3}}, {"who": BOB}]
        return [await bench.runner.act(request._replace(**other), "a1") for other in (*others, {})]

    first, *others, again = asyncio.run(work())
    assert first is again
    assert {receipt.code for receipt in others} == {"press_id_reused"}
    assert bench.counters == {"parts": 2}
    assert len(bench.log.entries) == 1


def test_the_permission_of_a_row_is_by_principal_act_and_server(bench: Bench) -> None:
    assert bench.increase("a1", BOB).code == "control_no_cookie"
    bench.guard.verdict = locked("server_shutting_down")
    ending = bench.increase("a2")
    assert (ending.code, ending.cause) == ("server_shutting_down", "link")
    assert bench.counters == {"parts": 0}
    assert bench.changes == 0
    assert bench.run(ActRequest("reset", BOB), "a3").outcome == "accepted"
    assert [entry.outcome for entry in bench.log.entries] == ["refused", "refused", "accepted"]


def test_refusal_of_an_act_is_answered_and_logged_with_its_sentence(bench: Bench) -> None:
    receipt = bench.increase("a1", name="other")
    assert (receipt.outcome, receipt.code, receipt.cause) == (
        "refused",
        "control_changed",
        "interlock",
    )
    assert bench.log.entries[0].reason == str(say("control_changed"))


def test_an_act_that_is_not_in_the_table_is_not_found(bench: Bench) -> None:
    with pytest.raises(NotFound, match='no act "steal": there is increase, reset'):
        bench.run(ActRequest("steal", ANN), "a1")


# Every row of every table.

EVERY: Final[Sequence[tuple[Kind, Mapping[str, Act[Any, Any]]]]] = (*TABLES, ("access", USER_ACTS))
ROWS: Final = [(kind, acts, name) for kind, acts in EVERY for name in acts]


@pytest.mark.parametrize(("kind", "acts", "name"), ROWS, ids=[f"{kind} {n}" for kind, _, n in ROWS])
def test_every_act_has_its_role_its_receipt_its_entry_and_its_word(
    kind: Kind, acts: Mapping[str, Act[Any, Any]], name: str
) -> None:
    act, log, guard = acts[name], Log(), Guard()
    runner = ActRunner(kind, acts, None, ActContext(guard, PressLog(log, "r1"), "", lambda: None))
    guard.verdict = locked("server_shutting_down")

    def refused(role: str) -> ActReceipt:
        return asyncio.run(runner.act(ActRequest(name, replace(ANN, role=role)), f"{role} {name}"))

    if act.needs != ANYBODY:
        receipt = refused(VIEWER)
        assert (receipt.outcome, receipt.code, receipt.cause) == ("refused", "role_needed", "role")
    if act.permission is not always:
        receipt = refused(ENGINEER)
        assert (receipt.outcome, receipt.code) == ("refused", "server_shutting_down")
    for entry in log.entries:
        assert (entry.kind, entry.action, entry.robot) == (kind, f"{kind}_{name}", "r1")
    if kind == "access":
        assert name in CHANGES or name == END  # which changes no user
    else:
        assert ACTION_WORDS[f"{kind}_{name}"] == act.word
        assert act.word in sentences("en")

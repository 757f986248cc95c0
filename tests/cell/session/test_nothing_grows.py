"""Thousands of calls, many of them never answered: the kiosk's memory stays where it was.

The robot is a Zenoh peer in this process, with the keys and tokens of one behind the bridge. Like
the bridge, it never lets go of a request that is not answered.
"""

import http.client
import json
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
import zenoh
from zenoh.handlers import Callback

from app.cell.commands.receipts import PAST_IDS_KEPT, RECEIPTS_KEPT
from app.ros.dialects import bridge_dialect
from tests.support.builders import INTERFACES
from tests.support.form import several
from tests.support.parts import ROOT, Server, free_port, until, zenoh_file

pytestmark = pytest.mark.long("flood")

TRIGGER = "std_srvs/srv/Trigger"
ANSWERED = [f"answered_{n}" for n in range(9)]
MUTE = [f"mute_{n}" for n in range(20)]
TIMEOUT_S = 0.2
ANSWERED_S = 5.0  # in time on a busy machine; Zenoh keeps something of each call for so long
CALLS, UNANSWERED = several(1_200, 10_000), several(120, 1_000)
# After them all caches are full, and Zenoh keeps as much as after the others.
FIRST_CALLS, FIRST_UNANSWERED = several(1_200, 4_000), several(100, 200)
LAST_CALLS = -(-RECEIPTS_KEPT // len(ANSWERED))  # of each service that answers
GROWTH_KB = 4_000  # of what the process has: half of it is what SQLite keeps of its file
PAST_ID_BYTES = 200  # an id of 32 characters, in an ordered dictionary; `PAST_IDS_KEPT` of them at most
MOST_KNOWN = 400  # answers of the graph: a few for each name that the panel uses
STRAY_OBJECTS = 300  # caches of the interpreter and of libraries
PASSING_TASKS = 3  # of a question or a connection that is just about to end; a leak has thousands


class Robot:
    """Offers all services, and answers those of `ANSWERED`."""

    def __init__(self) -> None:
        self.endpoint = f"tcp/127.0.0.1:{free_port()}"
        config = zenoh.Config()
        for place, value in {
            "mode": '"peer"',
            "listen/endpoints": f'["{self.endpoint}"]',
            "scouting/multicast/enabled": "false",
            "scouting/gossip/enabled": "false",
        }.items():
            config.insert_json5(place, value)
        self._session = zenoh.open(config)
        self._unanswered: list[zenoh.Query] = []
        zid = str(self._session.zid())
        done = INTERFACES.encode(f"{TRIGGER}_Response", {"success": True, "message": "done"})
        self._serves = [
            self._answering(bridge_dialect.version(zid), b'"1.10.2"'),
            *(self._answering(name, done) for name in ANSWERED),
            *(self._session.declare_queryable(n, Callback(self._keep, indirect=False)) for n in MUTE),
        ]
        tokens = [bridge_dialect.server_token(zid, "SS", name, TRIGGER) for name in (*ANSWERED, *MUTE)]
        declare = self._session.liveliness().declare_token
        self._tokens = [declare(token) for token in (*tokens, bridge_dialect.bridge_token(zid))]

    def _answering(self, key: str, payload: bytes) -> "zenoh.Queryable[None]":
        def answer(query: zenoh.Query) -> None:
            with query:
                query.reply(key, payload)

        return self._session.declare_queryable(key, Callback(answer, indirect=False))

    def _keep(self, query: zenoh.Query) -> None:
        self._unanswered.append(query)

    @property
    def unanswered(self) -> int:
        return len(self._unanswered)

    def close(self) -> None:
        for query in self._unanswered:
            query.drop()
        self._session.close()


@pytest.fixture
def robot() -> Iterator[Robot]:
    mine = Robot()
    yield mine
    mine.close()


@pytest.fixture
def kiosk(robot: Robot, tmp_path: Path) -> Iterator[Server]:
    panel = tmp_path / "calls.toml"
    widgets = "".join([*(widget(name, ANSWERED_S) for name in ANSWERED), *map(widget, MUTE)])
    panel.write_text(f'title = "Calls"\nmode = "live"\n[[page]]\nid = "p"\ntitle = "P"\n{widgets}')
    mine = Server(
        ROOT,
        app="tests.support.apps.counted:app",
        KIOSK_PANEL=str(panel),
        KIOSK_ZENOH=str(zenoh_file(tmp_path, robot.endpoint)),
        KIOSK_LOG_LEVEL="error",
    )
    until(lambda: all(w["enabled"] for w in mine.snapshot()["widgets"].values()), "all is offered")
    yield mine
    mine.end()


def widget(name: str, timeout_s: float = TIMEOUT_S) -> str:
    return f"""
        [[page.widget]]
        id = "{name}"
        kind = "call"
        label = "{name}"
        service = "/{name}"
        type = "{TRIGGER}"
        timeout_s = {timeout_s}
    """


def pressed(kiosk: Server, name: str, times: int) -> Counter[str]:
    """Outcomes of presses of one widget, one after the other on one connection."""
    outcomes: Counter[str] = Counter()
    connection = http.client.HTTPConnection("127.0.0.1", kiosk.port, timeout=10)
    headers = {"content-type": "application/json"}
    for _ in range(times):
        connection.request("POST", f"/widgets/{name}", b'{"inputs": {}}', headers)
        outcomes[json.loads(connection.getresponse().read())["outcome"]] += 1
    connection.close()
    return outcomes


def called(kiosk: Server, calls: int, unanswered: int) -> Counter[str]:
    """Outcomes of so many calls. The last ones are all answered: the receipts that are kept have the
    same number of objects each time."""
    answered = (calls - unanswered) // len(ANSWERED) - LAST_CALLS
    assert answered > 0
    mixed = dict.fromkeys(ANSWERED, answered) | dict.fromkeys(MUTE, unanswered // len(MUTE))
    return side_by_side(kiosk, mixed) + side_by_side(kiosk, dict.fromkeys(ANSWERED, LAST_CALLS))


def side_by_side(kiosk: Server, counts: dict[str, int]) -> Counter[str]:
    """Outcomes of so many calls of each service, all services at once."""
    with ThreadPoolExecutor(len(counts)) as pool:
        done = [pool.submit(pressed, kiosk, name, times) for name, times in counts.items()]
    return sum((task.result() for task in done), Counter())


def rest(kiosk: Server) -> tuple[dict[str, int], int]:
    """What the kiosk holds when no answer is waited for any more, and its memory in kB."""
    sizes: dict[str, int] = {}

    def nothing_open() -> bool:
        sizes.update(kiosk.http.get("/sizes").json())
        return sizes["ServiceCalls._open"] == sizes["BridgeLiveness._queries"] == 0

    nothing_open()  # the first look makes what Python keeps of what it looked at
    until(nothing_open, "no answer is waited for")
    status = Path(f"/proc/{kiosk.process.pid}/status").read_text()
    (line,) = [line for line in status.splitlines() if line.startswith("VmRSS")]
    return sizes, int(line.split()[1])


def test_thousands_of_calls_leave_nothing_behind(kiosk: Server, robot: Robot) -> None:
    called(kiosk, FIRST_CALLS, FIRST_UNANSWERED)
    before, memory_before = rest(kiosk)
    outcomes = called(kiosk, CALLS, UNANSWERED)
    assert outcomes == {"succeeded": CALLS - UNANSWERED, "timed_out": UNANSWERED}
    assert robot.unanswered == UNANSWERED + FIRST_UNANSWERED
    after, memory_after = rest(kiosk)
    assert after.pop("objects") - before.pop("objects") < STRAY_OBJECTS
    assert after.pop("Presses._past_ids") - before.pop("Presses._past_ids") == CALLS < PAST_IDS_KEPT
    assert max(after.pop("LiveGraph.cache"), before.pop("LiveGraph.cache")) < MOST_KNOWN
    assert abs(after.pop("tasks") - before.pop("tasks")) < PASSING_TASKS
    assert after == before
    assert before["Presses._receipts"] == RECEIPTS_KEPT
    assert memory_after - memory_before < GROWTH_KB + CALLS * PAST_ID_BYTES // 1000

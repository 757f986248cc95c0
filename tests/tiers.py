"""The tiers of the tests, each with its command:

- `test`: `make test`. Needs no Rust and no ROS: pure tests, servers with a simulated robot or a bare
  Zenoh peer, and Chromium for what only a browser shows.
- `robot`: `make test-robot`. The real bridge, ROS 2 nodes, brokers, proxies, other browsers,
  namespaces.
- `long`: `make test-long`. Real time, floods, faults, every screen, many random inputs, packaging.

The tier of a test follows from the fixtures that it takes and from the marker `long`.
`pytest --tiers` lists them. `python -m tests.tiers [ARGUMENT OF PYTEST]…` prints the targets of the
Makefile that set up what the tests need; exit status 2: the tests can't be collected.
`python -m tests.tiers --promises [PAGE]` prints the table of promises, and writes it into a page.
"""

import io
import sys
from collections import Counter
from collections.abc import Iterable, Mapping
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Final, Literal, get_args

import pytest

Tier = Literal["test", "robot", "long"]
TIERS: Final[tuple[Tier, ...]] = get_args(Tier)

# The fixtures for which a test belongs to `robot`.
ROBOT_FIXTURES: Final = frozenset(
    {
        *("domain", "cyclone_bridge", "own_cyclone_bridge", "cyclone_robots", "ros", "hiroz", "zenohd"),
        *("other_browser", "screens", "sway"),
        *("broker", "postgres", "proxies", "minisign", "systemd", "namespaces"),
    }
)
BROWSER_FIXTURE: Final = "chromium"

# The arguments of the marker `long`: why a test is not in another tier.
REASONS: Final[Mapping[str, str]] = {
    "real time": "measures real time, such as when a hold ends: runs alone, repeated once if it fails",
    "fault": "breaks a part while presses go on, or kills it many times",
    "flood": "more load than a cell has",
    "every screen": "each size, theme, font or language; the first and the last stay in their own tier",
    "table": "each case of a long table; the first and the last stay in their own tier",
    "random": "many random inputs",
    "packaging": "builds or installs the wheel, the release or the services",
    "documents": "runs what the documentation says",
    "detail": "a variant of a promise that another test has in its own tier",
}
ALONE: Final = "real time"
CORNERS: Final = ("every screen", "table")

# The arguments of the marker `promise`: what users rely on.
PROMISES: Final[Mapping[str, str]] = {
    "locks": "a control whose permission is unknown, old or cut off is locked, with its reason",
    "press": "the server checks again at the press, and the newest `false` counts",
    "offline": "what is pressed without a connection is never sent later",
    "receipt": "each press gets one receipt; the same id is the same press, over a restart too",
    "log": "the log says who pressed what, and the result; it can be verified",
    "hold": "a hold ends with its finger, its page or its connection",
    "stop": "Stop works on every page, with other fingers on the screen, and says when it can't",
    "stops": "the first cause of a stop is the right one, or it is said that it can't be told",
    "alarms": "alarms follow the table of states; none is lost over a restart",
    "recipes": "a recipe is loaded whole or not at all",
    "users": "no one acts without the role; the delays of the sign-in lock out no one else",
    "control": "one browser at a time is in control; each press reaches the robot on its screen",
    "numbers": "a number is sent as it is shown, or refused, in each language",
    "values": "values, units and types are shown as the robot has them; sizes are checked",
    "places": "a goal on a map is refused with its reason, or sent exactly as its card shows it, once",
    "dialects": "topics, services, actions and parameters over the bridge and on rmw_zenoh",
    "reconnect": "a page that was cut off gets the whole state; a slow one costs no queue",
    "fingers": "touch, several fingers, gloves, keyboard and readers",
    "layout": "no text is cut and no page scrolls, in the languages and sizes",
    "scripts": "pages work without scripts, and say what does not",
    "panel file": "each mistake in a panel file is named with its line",
    "demo": "the simulated robot obeys the panel file",
    "doctor": "the doctor finds what is wrong, and says what to do",
    "history": "trends and recordings are whole and bounded",
    "security": "requests are checked: host, origin, size, rate; secrets leave no trace",
    "neighbours": "proxies, TLS, brokers and identity providers as the guides set them up",
    "kiosk": "the kiosk starts, is watched, updated and rolled back",
    "documents": "what README and docs say can be run",
}
MARKERS: Final = (
    "long(reason): runs in `make test-long` only; the reasons are in tests/tiers.py",
    "promise(name): tests a promise of the table in tests/tiers.py",
)
BEGIN: Final = "<!-- promises -->\n"
END: Final = "<!-- /promises -->\n"


class TierError(Exception):
    """A test whose marker `long` or `promise` is not in the table, or a promise without a test."""


IS_CORNER: Final = pytest.StashKey[bool]()


def mark_corners(items: Iterable[pytest.Item]) -> None:
    """Of each test with parameters, the first and the last case are its corners."""
    cases: dict[str, list[pytest.Item]] = {}
    for item in items:
        if getattr(item, "callspec", None) is not None:
            cases.setdefault(item.nodeid.partition("[")[0], []).append(item)
    for of_test in cases.values():
        of_test[0].stash[IS_CORNER] = of_test[-1].stash[IS_CORNER] = True


def reason(item: pytest.Item) -> str | None:
    """The reason of a test's marker `long`; None without the marker, or where `long(None)` at a test
    takes back that of its module."""
    marker = item.get_closest_marker("long")
    if marker is None or marker.args == (None,):
        return None
    if len(marker.args) == 1 and marker.args[0] in CORNERS and item.stash.get(IS_CORNER, False):
        return None
    if len(marker.args) != 1 or marker.args[0] not in REASONS:
        raise TierError(f"{item.nodeid}: long{marker.args}; the reasons are {', '.join(REASONS)}")
    return str(marker.args[0])


def fixtures(item: pytest.Item) -> frozenset[str]:
    return frozenset(getattr(item, "fixturenames", ()))


def takes_browser(item: pytest.Item) -> bool:
    return BROWSER_FIXTURE in fixtures(item)


def needs_part(item: pytest.Item) -> bool:
    """Whether a test needs a real part other than the browser."""
    return not ROBOT_FIXTURES.isdisjoint(fixtures(item))


def tier_of(item: pytest.Item) -> Tier:
    if reason(item) is not None:
        return "long"
    return "robot" if needs_part(item) else "test"


def is_random(item: pytest.Item) -> bool:
    """Whether hypothesis chooses the test's inputs: few in its own tier, many in `long`."""
    return bool(getattr(getattr(item, "obj", None), "is_hypothesis_test", False))


def runs_in(item: pytest.Item, tier: Tier) -> bool:
    return tier_of(item) == tier or (tier == "long" and is_random(item))


def table(items: Iterable[pytest.Item]) -> list[str]:
    """A line for each file and one for all: its tests in each tier."""
    files: dict[str, Counter[str]] = {}
    for item in items:
        files.setdefault(item.nodeid.partition("::")[0], Counter())[tier_of(item)] += 1
    rows = [*sorted(files.items()), ("all", sum(files.values(), Counter()))]
    heading = "".join(f"{tier:>7}" for tier in TIERS) + "  file"
    return [heading, *("".join(f"{n[tier]:7}" for tier in TIERS) + f"  {name}" for name, n in rows)]


def promises(items: Iterable[pytest.Item]) -> str:
    """The table of promises, as Markdown: the files that test each of them, by their tiers."""
    files: dict[str, dict[Tier, set[str]]] = {
        name: {tier: set() for tier in TIERS} for name in PROMISES
    }
    for item in items:
        for marker in item.iter_markers("promise"):
            if marker.args[0] not in files:
                raise TierError(f"{item.nodeid}: promise{marker.args} is not in PROMISES")
            file = item.nodeid.partition("::")[0].removeprefix("tests/").removesuffix(".py")
            files[marker.args[0]][tier_of(item)].add(f"`{file.replace('test_', '')}`")
    untested = [name for name, tested in files.items() if not tested["test"]]
    if untested:
        raise TierError(f"`make test` has no test of {', '.join(untested)}")
    lines = [
        "| promise | `make test` | `make test-robot` | `make test-long` |",
        "| --- | --- | --- | --- |",
    ]
    for name, tested in files.items():
        cells = [", ".join(sorted(tested[tier])) or "–" for tier in TIERS]
        lines.append(f"| {PROMISES[name]} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


class Collected:
    """A plugin: the collected tests, and the targets of the Makefile that they need."""

    def __init__(self) -> None:
        self.items: list[pytest.Item] = []
        self.targets: set[str] = set()

    def pytest_collection_finish(self, session: pytest.Session) -> None:
        self.items = session.items
        if any(map(takes_browser, session.items)):
            self.targets.add("browser")
        if any(map(needs_part, session.items)):
            self.targets.add("test-parts")


def main(arguments: list[str]) -> None:
    of_promises = arguments[:1] == ["--promises"]
    collected = Collected()
    output = io.StringIO()
    with redirect_stdout(output), redirect_stderr(output):
        chosen = [] if of_promises else arguments
        status = pytest.main([*chosen, "--collect-only", "-q"], plugins=[collected])
    if status != pytest.ExitCode.OK:
        print(output.getvalue(), end="", file=sys.stderr)
        sys.exit(2)
    if of_promises:
        written = promises(collected.items)
        print(written, end="")
        for page in map(Path, arguments[1:]):
            before, _, rest = page.read_text().partition(BEGIN)
            page.write_text(f"{before}{BEGIN}{written}{END}{rest.partition(END)[2]}")
    elif collected.targets:
        print(*sorted(collected.targets))


if __name__ == "__main__":
    from tests import tiers  # the module that conftest imports

    tiers.main(sys.argv[1:])

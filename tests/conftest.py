"""Fixtures: real parts. They are shared where possible, and always ended.

What only some tests need (Zenoh, Playwright, Hypothesis, HTTP) is imported where it is used: tests of
pure functions start without it.
"""

from __future__ import annotations

import gc
import shutil
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Generator, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from app.system.texts import ENGLISH, sentences
from tests import tiers
from tests.support import checkout, domains, form
from tests.support.browser.drivers import OTHER_BROWSERS
from tests.support.places import BRIDGE, CHROMIUM, HEADLESS, RMW_ROBOT, ROOT, ROS_PYTHON, ZENOHD

if TYPE_CHECKING:
    import zenoh
    from playwright.sync_api import Browser, Page

    from tests.support.browser.browsers import Browsers, ReusedPage
    from tests.support.parts import Bridge, RosNode, Server

sentences(ENGLISH)  # read before any test measures time
# Else, with PYTHONDONTWRITEBYTECODE, each run compiles all tests again.
sys.dont_write_bytecode = False

# What a test of the browser, and one with other real parts, needs on this machine.
BROWSER_FILES = (CHROMIUM, HEADLESS)
ROBOT_FILES = (BRIDGE, RMW_ROBOT, ZENOHD, ROS_PYTHON, *OTHER_BROWSERS)


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--tier", choices=tiers.TIERS, help="run the tests of this tier")
    parser.addoption("--alone", choices=("only", "without"), help="tests that must run alone")
    parser.addoption("--outcomes", type=Path, help="file to which a line for each test is appended")
    parser.addoption("--tiers", action="store_true", help="list how many tests each tier has")


def pytest_configure(config: pytest.Config) -> None:
    for marker in tiers.MARKERS:
        config.addinivalue_line("markers", marker)
    if (path := config.getoption("--outcomes")) and not hasattr(config, "workerinput"):
        from tests.long import Outcomes

        config.pluginmanager.register(Outcomes(path))
    if config.getoption("--tiers"):
        config.option.collectonly = True


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Without garbage collection: collected tests are no garbage, and scanning them costs time."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


def pytest_pycollect_makemodule(module_path: Path) -> None:
    """Loads the profile of Hypothesis before a module that imports it, also where another package has
    imported it before."""
    if not form.has_profile() and b"from hypothesis import" in module_path.read_bytes():
        form.load_hypothesis_profile()


def pytest_make_parametrize_id(val: object, argname: str) -> str | None:
    """Bytes are not shown in a test's name: packed ones differ from second to second, and the workers
    would collect different tests."""
    return argname if isinstance(val, bytes | bytearray) else None


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leaves out the tests of other tiers, and those with a browser if there is none. Repeats failed
    tests of real time once, and no others. Sorts the files: first those with a browser, which share it
    and begin with its tests, then those with the most tests on real parts. So no slow file starts last;
    files without real parts fill the rest."""
    tiers.mark_corners(items)
    tier, alone = config.getoption("--tier"), config.getoption("--alone")
    without_browser = tier == "test" and missing(BROWSER_FILES)

    def chosen(item: pytest.Item) -> bool:
        return (
            (tier is None or tiers.runs_in(item, tier))
            and (alone is None or (tiers.reason(item) == tiers.ALONE) == (alone == "only"))
            and not (without_browser and tiers.takes_browser(item))
        )

    for item in items:
        assert not item.get_closest_marker("flaky"), f"{item.nodeid}: may not be repeated"
        if tiers.reason(item) == tiers.ALONE:
            item.add_marker(pytest.mark.flaky(reruns=1))
    left_out = [item for item in items if not chosen(item)]
    if left_out:
        config.hook.pytest_deselected(items=left_out)
        items[:] = [item for item in items if chosen(item)]
    on_parts = Counter(item.path for item in items if tiers.needs_part(item))
    in_browser = {item.path for item in items if tiers.takes_browser(item)}

    def place(item: pytest.Item) -> tuple[bool, int, Path, bool]:
        first = not tiers.takes_browser(item)
        return item.path not in in_browser, -on_parts[item.path], item.path, first

    items.sort(key=place)


def missing(files: tuple[str | Path, ...]) -> list[str]:
    return [str(file) for file in files if not Path(file).exists()]


def pytest_collection_finish(session: pytest.Session) -> None:
    """No test is skipped: if a real part is missing that a test needs, the run ends."""
    if session.config.option.collectonly:
        return
    files = [
        *(missing(BROWSER_FILES) if any(map(tiers.takes_browser, session.items)) else ()),
        *(missing(ROBOT_FILES) if any(map(tiers.needs_part, session.items)) else ()),
    ]
    if files:
        pytest.exit(f"missing: {', '.join(files)}; `make test-robot` installs them", returncode=3)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """The table of tiers, and why each repeated test failed at first."""
    for report in terminalreporter.stats.get("rerun", ()):
        terminalreporter.write_sep("_", f"repeated: {report.nodeid}")
        report.toterminal(terminalreporter._tw)
    if config.getoption("--tiers"):
        session = terminalreporter._session
        assert session is not None
        for line in tiers.table(session.items):
            terminalreporter.write_line(line)
    if config.getoption("--tier") == "test" and (files := missing(BROWSER_FILES)):
        terminalreporter.write_line(f"NOT RUN: the tests with a browser: {', '.join(files)} is missing")


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    """A run of a tier whose tests with a browser were left out is not green."""
    if session.config.getoption("--tier") == "test" and missing(BROWSER_FILES) and exitstatus == 0:
        session.exitstatus = 3


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item,
    call: pytest.CallInfo[None],
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Adds to a failure the last output of processes that run, or that started with the test."""
    report = yield
    if report.failed:
        from tests.support.browser.browsers import FAILED
        from tests.support.parts import Process

        item.stash[FAILED] = True
        began = time.monotonic() - call.duration - 10
        shown = [process for process in Process.latest if process.running or process.began > began]
        report.sections += [("a process", process.describe()) for process in shown]
    return report


@pytest.fixture(scope="session", autouse=True)
def temporary_files(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """The folder for temporary files of tests and their processes; removed at the end."""
    folder = tmp_path_factory.mktemp("tmp", numbered=False)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("TMPDIR", str(folder))
        patch.setattr(tempfile, "tempdir", str(folder))
        yield
    shutil.rmtree(folder)


@pytest.fixture(scope="session", autouse=True)
def unchanged_checkout() -> Iterator[None]:
    """An error of the last test if one has written into the checkout, where a reader's own files may
    lie."""
    before = checkout.state()
    yield
    after = checkout.state()
    changed = sorted(line for line, _ in before.items() ^ after.items())
    assert not changed, f"written in the checkout during the tests: {changed}"


@pytest.fixture(scope="session", autouse=True)
def patient_log() -> None:
    """Longer waits for the disk in this process, as in forked servers."""
    if "app.records" in sys.modules:
        from tests.support.operator_log import wait_for_the_disk

        wait_for_the_disk()


@pytest.fixture(autouse=True)
def callbacks_that_succeed() -> Iterator[None]:
    """An error of a test in whose process a callback of Zenoh's has failed: else only a time that is
    over would tell. Servers of tests look for it when they end."""
    if "app.ros.zenoh.answers" not in sys.modules:
        yield
        return
    from app.ros.zenoh.answers import callback_errors

    before = callback_errors.count
    yield
    assert callback_errors.count == before, "a callback on a thread of Zenoh's failed: see the log"


@pytest.fixture(scope="session")
def domain() -> int:
    return domains.first()


@pytest.fixture(scope="session")
def hiroz() -> Path:
    """A ROS 2 node in Rust, on hiroz: `tests/rmw_crate/`."""
    return RMW_ROBOT


# Tests that take one of these start programs: zenohd of the cache, the others of the system
# (`tests/system.sh`).
@pytest.fixture(scope="session")
def zenohd() -> None:
    """The Zenoh router as published: `Router` in `tests/support/rmw.py`."""


@pytest.fixture(scope="session")
def proxies() -> None:
    """nginx and Caddy."""


@pytest.fixture(scope="session")
def minisign() -> None:
    """minisign signs."""


@pytest.fixture(scope="session")
def systemd() -> None:
    """systemd-analyze and systemd-sysusers check units."""


@pytest.fixture(scope="session")
def namespaces() -> None:
    """Mount and network namespaces, by `unshare`."""


@pytest.fixture(scope="session")
def bridge(domain: int) -> Iterator[Bridge]:
    """The bridge that tests share. A test that ends its bridge uses `own_bridge`."""
    from tests.support.parts import Bridge

    shared = Bridge(domain)
    shared.start()
    yield shared
    shared.end()


@pytest.fixture(scope="session")
def node(domain: int, bridge: Bridge) -> Iterator[RosNode]:
    """The robot's system_controller: subscribes to the panel's topics."""
    from tests.support.parts import RosNode

    shared = RosNode(domain)
    for topic in ("/operation", "/operation1", "/operation2"):
        shared.subscribe(topic, "std_msgs/msg/String")
    shared.subscribe("/rosout", "rcl_interfaces/msg/Log", depth=1000)
    yield shared
    shared.end()


@pytest.fixture(scope="module")
def jogger(node: RosNode) -> Iterator[RosNode]:
    """The node of a robot that is jogged: subscribes to the commands and publishes the permission."""
    from tests.support import holds

    node.subscribe(holds.TOPIC, "geometry_msgs/msg/Point", depth=1000)
    node.advertise("/operation_enabled", "std_msgs/msg/Bool")
    yield node
    node.withdraw("/operation_enabled")


@pytest.fixture
def own_bridge(domain: int) -> Iterator[Bridge]:
    """A bridge on a separate domain, which a test may end, freeze and start again."""
    from tests.support.parts import Bridge

    mine = Bridge(domain + 1)
    mine.start()
    yield mine
    mine.end()


@pytest.fixture
def own_node(own_bridge: Bridge) -> Iterator[RosNode]:
    """A node behind `own_bridge`."""
    from tests.support.parts import RosNode

    mine = RosNode(own_bridge.domain)
    yield mine
    mine.end()


@pytest.fixture
def servers() -> Iterator[Callable[[Server], Server]]:
    """Ends the servers that are given to it after the test."""
    with ExitStack() as stack:

        def kept(server: Server) -> Server:
            stack.callback(server.end)
            return server

        yield kept


@pytest.fixture(params=["post", "socket"])
def way(request: pytest.FixtureRequest) -> str:
    """How presses are sent: by POST or by WebSocket."""
    return str(request.param)


@pytest.fixture
def server(bridge: Bridge, node: RosNode, tmp_path: Path) -> Iterator[Server]:
    """A server for one test, on the shared bridge."""
    from tests.support.parts import live

    mine = live(bridge.endpoint, tmp_path)
    yield mine
    mine.end()


@pytest.fixture(scope="module")
def demo() -> Iterator[Server]:
    """A server with the reference system's panel and its simulated robot."""
    from tests.support.parts import Server
    from tests.support.servers import ready

    with ready(Server(ROOT)) as mine:
        yield mine


@pytest.fixture
def peer() -> Iterator[tuple[str, zenoh.Session]]:
    """An endpoint and the session that listens there."""
    import zenoh

    from tests.support.parts import free_port

    endpoint = f"tcp/127.0.0.1:{free_port()}"
    config = zenoh.Config()
    config.insert_json5("listen/endpoints", f'["{endpoint}"]')
    config.insert_json5("scouting/multicast/enabled", "false")
    config.insert_json5("timestamping/enabled", "true")  # as a bridge has it
    with zenoh.open(config) as session:
        yield endpoint, session


@pytest.fixture
def time_zone(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[str], None]]:
    """Sets the server's time zone, until the end of the test."""

    def set_zone(name: str) -> None:
        monkeypatch.setenv("TZ", name)
        time.tzset()

    yield set_zone
    monkeypatch.undo()
    time.tzset()


@pytest.fixture
def utc(time_zone: Callable[[str], None]) -> None:
    """The server's time zone is UTC."""
    time_zone("UTC")


@pytest.fixture(scope="module")
def fonts() -> str:
    """The browser's set of fonts. A module that tests layout overrides this fixture."""
    return "noto"


@pytest.fixture(scope="session")
def browser_sets() -> Iterator[Browsers]:
    from playwright.sync_api import expect

    from tests.support.browser.browsers import BROWSERS
    from tests.support.parts import ENOUGH_S

    expect.set_options(timeout=1000 * ENOUGH_S)
    yield BROWSERS
    BROWSERS.close()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_teardown(item: pytest.Item, nextitem: pytest.Item | None) -> Generator[None]:
    """Keeps browsers if the next module begins with one, else closes them: while Playwright runs, its
    event loop runs in this thread, and tests in other modules need their own."""
    yield
    if (
        nextitem is not None
        and item.path != nextitem.path
        and not tiers.takes_browser(nextitem)
        and (module := sys.modules.get("tests.support.browser.browsers"))
    ):
        module.BROWSERS.close()


@pytest.fixture(scope="module")
def chromium(fonts: str, browser_sets: Browsers, tmp_path_factory: pytest.TempPathFactory) -> Browser:
    return browser_sets.browser(fonts, tmp_path_factory)


@pytest.fixture(scope="module")
def reused_page(chromium: Browser) -> Iterator[ReusedPage]:
    from tests.support.browser.browsers import ReusedPage

    mine = ReusedPage(chromium)
    yield mine
    mine.close()


@pytest.fixture
def page(reused_page: ReusedPage, request: pytest.FixtureRequest) -> Iterator[Page]:
    """A page that the tests of a module share, reset for each. An error on its console fails a test."""
    with reused_page.taken(request.node) as page:
        yield page


@pytest.fixture
def own_page(chromium: Browser, request: pytest.FixtureRequest) -> Iterator[Page]:
    """A page for one test, for changes that cannot be reset, such as an init script."""
    from tests.support.browser.browsers import ReusedPage

    mine = ReusedPage(chromium)
    with mine.taken(request.node) as page:
        yield page
    mine.close()


@pytest.fixture(scope="module")
def reused_page_without_scripts(chromium: Browser) -> Iterator[ReusedPage]:
    from tests.support.browser.browsers import ReusedPage

    mine = ReusedPage(chromium, java_script_enabled=False)
    yield mine
    mine.close()


@pytest.fixture
def without_scripts(
    reused_page_without_scripts: ReusedPage, request: pytest.FixtureRequest
) -> Iterator[Page]:
    """A page with scripts off, which the tests of a module share."""
    with reused_page_without_scripts.taken(request.node) as page:
        yield page

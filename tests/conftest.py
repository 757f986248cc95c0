"""Fixtures: real parts. They are shared where possible, and always ended."""

import gc
import shutil
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Generator, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
import zenoh
from hypothesis import HealthCheck, settings
from playwright.sync_api import Browser, Page, expect

from app.i18n import ENGLISH, sentences
from tests.needs import needs_part, needs_parts
from tests.support import checkout, domains, failed_tests, holds
from tests.support.browser.browsers import BROWSERS, FAILED, Browsers, ReusedPage
from tests.support.browser.drivers import OTHER_BROWSERS
from tests.support.operator_log import wait_for_the_disk
from tests.support.parts import (
    BRIDGE,
    CHROMIUM,
    ENOUGH_S,
    HEADLESS,
    RMW_ROBOT,
    ROOT,
    ROS_PYTHON,
    Bridge,
    Process,
    RosNode,
    Server,
    free_port,
    live,
)
from tests.support.servers import ready

expect.set_options(timeout=1000 * ENOUGH_S)
# An example may take long on a busy machine.
settings.register_profile("busy", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("busy")
sentences(ENGLISH)  # read before any test measures time


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--real-time", choices=("only", "without"), help="tests that measure real time")
    parser.addoption("--write-failed", type=Path, help="file for the ids of failed tests")
    parser.addoption("--only-failed", type=Path, help="run the tests that such a file names")


def pytest_configure(config: pytest.Config) -> None:
    path = config.getoption("--write-failed")
    if path and not hasattr(config, "workerinput"):
        config.pluginmanager.register(failed_tests.FailedTests(path))


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Without garbage collection: collected tests are no garbage, and scanning them costs time."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Repeats failed tests of real time once, and no others. Sorts the files: first those with a
    browser, which share it and begin with its tests, then those with the most tests on real parts. So
    no slow file starts last; files without real parts fill the rest."""
    wanted = config.getoption("--real-time")
    if path := config.getoption("--only-failed"):
        failed = failed_tests.read(path)
        items[:] = [item for item in items if item.nodeid in failed]
    for item in items:
        assert not item.get_closest_marker("flaky"), f"{item.nodeid}: only `real_time` may be repeated"
        if item.get_closest_marker("real_time"):
            item.add_marker(pytest.mark.flaky(reruns=1))
    if wanted:
        left_out = [
            item for item in items if (item.get_closest_marker("flaky") is None) is (wanted == "only")
        ]
        config.hook.pytest_deselected(items=left_out)
        items[:] = [item for item in items if item not in set(left_out)]
    on_parts = Counter(item.path for item in items if needs_part(item))
    in_browser = {item.path for item in items if takes_browser(item)}

    def place(item: pytest.Item) -> tuple[bool, int, Path, bool]:
        return item.path not in in_browser, -on_parts[item.path], item.path, not takes_browser(item)

    items.sort(key=place)


def pytest_collection_finish(session: pytest.Session) -> None:
    """No test is skipped: if a real part is missing that a test needs, the run ends."""
    missing = [
        str(p)
        for p in (BRIDGE, RMW_ROBOT, ROS_PYTHON, CHROMIUM, HEADLESS, *OTHER_BROWSERS)
        if not Path(p).exists()
    ]
    if missing and needs_parts(session) and not session.config.option.collectonly:
        pytest.exit(f"missing: {', '.join(missing)}; `make test` installs them", returncode=3)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item,
    call: pytest.CallInfo[None],
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Adds to a failure the last output of processes that run, or that started with the test."""
    report = yield
    if report.failed:
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
    wait_for_the_disk()


@pytest.fixture(scope="session")
def domain() -> int:
    return domains.first()


@pytest.fixture(scope="session")
def bridge(domain: int) -> Iterator[Bridge]:
    """The bridge that tests share. A test that ends its bridge uses `own_bridge`."""
    shared = Bridge(domain)
    shared.start()
    yield shared
    shared.end()


@pytest.fixture(scope="session")
def node(domain: int, bridge: Bridge) -> Iterator[RosNode]:
    """The robot's system_controller: subscribes to the panel's topics."""
    shared = RosNode(domain)
    for topic in ("/operation", "/operation1", "/operation2"):
        shared.subscribe(topic, "std_msgs/msg/String")
    shared.subscribe("/rosout", "rcl_interfaces/msg/Log", depth=1000)
    yield shared
    shared.end()


@pytest.fixture(scope="module")
def jogger(node: RosNode) -> Iterator[RosNode]:
    """The node of a robot that is jogged: subscribes to the commands and publishes the permission."""
    node.subscribe(holds.TOPIC, "geometry_msgs/msg/Point", depth=1000)
    node.advertise("/operation_enabled", "std_msgs/msg/Bool")
    yield node
    node.withdraw("/operation_enabled")


@pytest.fixture
def own_bridge(domain: int) -> Iterator[Bridge]:
    """A bridge on a separate domain, which a test may end, freeze and start again."""
    mine = Bridge(domain + 1)
    mine.start()
    yield mine
    mine.end()


@pytest.fixture
def own_node(own_bridge: Bridge) -> Iterator[RosNode]:
    """A node behind `own_bridge`."""
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
    mine = live(bridge.endpoint, tmp_path)
    yield mine
    mine.end()


@pytest.fixture(scope="module")
def demo() -> Iterator[Server]:
    """A server with the reference system's panel and its simulated robot."""
    with ready(Server(ROOT)) as mine:
        yield mine


@pytest.fixture
def peer() -> Iterator[tuple[str, zenoh.Session]]:
    """An endpoint and the session that listens there."""
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
def browsers() -> Iterator[Browsers]:
    yield BROWSERS
    BROWSERS.close()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_teardown(item: pytest.Item, nextitem: pytest.Item | None) -> Generator[None]:
    """Keeps browsers if the next module begins with one, else closes them: while Playwright runs, its
    event loop runs in this thread, and tests in other modules need their own."""
    yield
    if nextitem is not None and item.path != nextitem.path and not takes_browser(nextitem):
        BROWSERS.close()


def takes_browser(item: pytest.Item) -> bool:
    return "chromium" in getattr(item, "fixturenames", ())


@pytest.fixture(scope="module")
def chromium(fonts: str, browsers: Browsers, tmp_path_factory: pytest.TempPathFactory) -> Browser:
    return browsers.browser(fonts, tmp_path_factory)


@pytest.fixture(scope="module")
def reused_page(chromium: Browser) -> Iterator[ReusedPage]:
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
    mine = ReusedPage(chromium)
    with mine.taken(request.node) as page:
        yield page
    mine.close()


@pytest.fixture(scope="module")
def reused_page_without_scripts(chromium: Browser) -> Iterator[ReusedPage]:
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

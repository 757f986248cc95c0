"""Firefox and WebKitGTK in tests, by WebDriver: each with its own folder, ports and screen."""

import os
import signal
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Final

import httpx
from selenium.webdriver import FirefoxOptions, Remote, WebKitGTKOptions
from selenium.webdriver.common.options import ArgOptions
from selenium.webdriver.remote.client_config import ClientConfig
from selenium.webdriver.remote.remote_connection import RemoteConnection

from tests.support.browser.drivers import FIREFOX, GECKODRIVER, MINI_BROWSER, WEBKIT_DRIVER, XVFB
from tests.support.parts import Process, free_port, http_client, until
from tests.support.processes.signals import send_signal

DIES_WITH_TESTS: Final = ("setpriv", "--pdeathsig", "KILL")
# With what a driver has started: a browser that hangs, too.
DIES_WHOLE: Final = (*DIES_WITH_TESTS, "unshare", "--pid", "--fork", "--kill-child", "--mount-proc")
SIZE: Final = (1280, 800)
PATIENCE_S: Final = 60  # of the driver, for a page
ENDS_WITHIN_S: Final = 25

# Nothing leaves this machine, and no page is opened but the test's.
FIREFOX_PREFERENCES: Final[Mapping[str, str | int | bool]] = {
    "app.normandy.enabled": False,
    "app.update.enabled": False,
    "browser.safebrowsing.downloads.enabled": False,
    "browser.safebrowsing.malware.enabled": False,
    "browser.safebrowsing.phishing.enabled": False,
    "browser.shell.checkDefaultBrowser": False,
    "datareporting.policy.dataSubmissionEnabled": False,
    "dom.ipc.processCount": 1,
    "dom.ipc.processPrelaunch.enabled": False,
    "extensions.update.enabled": False,
    "network.captive-portal-service.enabled": False,
    "network.connectivity-service.enabled": False,
    "services.settings.server": "data:,",
    "toolkit.telemetry.enabled": False,
}


@contextmanager
def screen() -> Iterator[str]:
    """The name of an X display that no one sees."""
    read, write = os.pipe()
    size = "x".join(str(length + 100) for length in SIZE)
    options = ("-displayfd", str(write), "-screen", "0", f"{size}x24", "-nolisten", "tcp")
    process = Process([*DIES_WITH_TESTS, str(XVFB), *options], {}, pass_fds=(write,))
    os.close(write)
    with os.fdopen(read) as answer:
        number = answer.readline().strip()
    try:
        yield f":{number}"
    finally:
        process.end()


@contextmanager
def browser(driver: Sequence[str], options: ArgOptions, env: Mapping[str, str]) -> Iterator[Remote]:
    """A browser that a driver has started, and the driver with it; both are ended."""
    port = free_port()
    process = Process([*DIES_WHOLE, *driver, f"--port={port}"], env)
    url = f"http://127.0.0.1:{port}"
    try:
        until(lambda: _responds(url), "the driver runs")
        connection = RemoteConnection(client_config=ClientConfig(remote_server_addr=url))
        remote = Remote(command_executor=connection, options=options)
        try:
            remote.set_page_load_timeout(PATIENCE_S)
            _resize(remote)
            yield remote
        finally:
            remote.quit()
    finally:
        _end_whole(process)


def _end_whole(process: Process) -> None:
    """Ends the driver by its end as the first process of its namespace, which ends all others there."""
    for child in Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split():
        send_signal(int(child), signal.SIGKILL)
    process.wait(ENDS_WITHIN_S)
    process.end()


def _responds(url: str) -> bool:
    try:
        with http_client(url, 2.0) as http:
            return http.get("/status").status_code == 200
    except httpx.TransportError:
        return False


def _resize(remote: Remote) -> None:
    """Gives the page this size: the window has a frame."""
    remote.set_window_size(*SIZE)
    width, height = remote.execute_script("return [innerWidth, innerHeight]")
    remote.set_window_size(2 * SIZE[0] - width, 2 * SIZE[1] - height)


@contextmanager
def firefox(folder: Path) -> Iterator[Remote]:
    options = FirefoxOptions()
    options.binary_location = str(FIREFOX)
    options.add_argument("-headless")
    for name, value in FIREFOX_PREFERENCES.items():
        options.set_preference(name, value)
    env = {"HOME": str(folder), "TMPDIR": str(folder), "MOZ_CRASHREPORTER_DISABLE": "1"}
    driver = (str(GECKODRIVER), f"--websocket-port={free_port()}")
    with browser(driver, options, env) as remote:
        yield remote


@contextmanager
def webkit(folder: Path, language: str) -> Iterator[Remote]:
    """`language` is a locale of the system, such as "C"."""
    options = WebKitGTKOptions()
    options.binary_location = str(MINI_BROWSER)
    options.add_argument("--automation")
    with screen() as display:
        env = {"DISPLAY": display, "GDK_BACKEND": "x11", "NO_AT_BRIDGE": "1", "HOME": str(folder)}
        env |= {"LANG": language, "LC_ALL": language, "LANGUAGE": "", "XDG_RUNTIME_DIR": str(folder)}
        with browser([str(WEBKIT_DRIVER)], options, env) as remote:
            yield remote

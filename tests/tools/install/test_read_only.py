"""A root file system that is read-only, and a data folder that gets full under load."""

import subprocess
import threading
from collections.abc import Callable

import pytest

from tests.support.parts import ROOT, Server, sends, until

pytestmark = pytest.mark.usefixtures("namespaces")

READ_ONLY = ["unshare", "--mount", "sh", "-c"]
# The data folder is a separate file system, in which the server writes; nothing else is written, also
# where the folder for temporary files is a file system too.
MOUNT = (
    'around=$(findmnt -n -o TARGET -T "$KIOSK_DATA") && mount -t tmpfs {options}tmpfs "$KIOSK_DATA"'
    ' && for place in "$around" /; do mount -o remount,bind,ro "$place" || exit; done'
    ' && if touch "$KIOSK_DATA/../written"; then echo "/ is not read-only" >&2; exit 1; fi'
    ' && exec "$@"'
)
SMALL = "2m"
FULL = "no space left on device"
SENT = (200, False)


def remount(server: Server, how: str) -> None:
    enter = ["nsenter", "--mount", f"--target={server.process.pid}"]
    mount = ["mount", "-o", f"remount,{how}", str(server.data)]
    subprocess.run([*enter, *mount], check=True, capture_output=True)


def test_the_server_needs_its_data_folder_alone(servers: Callable[[Server], Server]) -> None:
    server = servers(Server(ROOT, before=[*READ_ONLY, MOUNT.format(options=""), "sh"]))
    until(server.ready, "ready")
    until(lambda: sends(server, "on a read-only root"), "a press is sent")
    assert server.http.get("/").status_code == 200


def test_a_data_folder_that_gets_full_under_load_locks_until_there_is_room(
    servers: Callable[[Server], Server],
) -> None:
    mount = MOUNT.format(options=f"-o size={SMALL} ")
    server = servers(Server(ROOT, before=[*READ_ONLY, mount, "sh"]))
    until(server.ready, "ready")
    answers: list[tuple[int, bool]] = []
    ends = threading.Event()

    def press() -> None:
        while not ends.is_set():
            answer = server.press("operation", "load")
            answers.append((answer.status_code, FULL in answer.text))

    presser = threading.Thread(target=press)
    presser.start()
    try:
        until(lambda: answers.count(SENT) >= 5, "presses are logged")
        fill = 'dd if=/dev/zero of="$0/filler" bs=4096 2>/dev/null; true'
        enter = ["nsenter", "--mount", f"--target={server.process.pid}"]
        subprocess.run([*enter, "sh", "-c", fill, str(server.data)], check=True)
        until(lambda: answers[-1] == (503, True), "presses are refused")
        assert server.widget("operation")["enabled"] is False
        subprocess.run([*enter, "rm", str(server.data / "filler")], check=True)
        remount(server, "size=100m")
        until(lambda: server.widget("operation")["enabled"], "it unlocks by itself")
        until(lambda: answers[-1] == SENT, "presses are logged again")
    finally:
        ends.set()
        presser.join()

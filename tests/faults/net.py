"""Network namespaces for a test, and a cable between two of them that can be cut, slow or lossy.

A namespace exists as long as the process that holds it, which ends with the pipe to the tests, so
nothing is left behind. Many kernels lack `tc netem`. So the cable is two veth pairs with a small
program in between (`wire.py`) that forwards the frames: TCP is exposed to the loss and the delay, on
any kernel.
"""

import ctypes
import fcntl
import json
import os
import socket
import struct
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, Final

CLONE_NEWNET: Final = 0x40000000
KIOSK_IP: Final = "10.99.0.1"
ROBOT_IP: Final = "10.99.0.2"

# linux/sockios.h, linux/ethtool.h: a frame that a program forwards needs its checksum, and must fit the
# MTU.
SIOCETHTOOL: Final = 0x8946
ETHTOOL_STXCSUM: Final = 0x17
ETHTOOL_STSO: Final = 0x1F
ETHTOOL_SGSO: Final = 0x24


class Namespace:
    """A network namespace with its loopback up."""

    def __init__(self) -> None:
        if os.geteuid() != 0:
            raise AssertionError("network namespaces need root: try `unshare -r -n make test`")
        hold = "ip link set lo up && echo up && exec cat"
        self._holder = subprocess.Popen(
            ["unshare", "--net", "sh", "-c", hold],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        assert self._holder.stdout is not None
        assert self._holder.stdout.readline() == "up\n", "no network namespace here"

    @classmethod
    def begun(cls, stack: ExitStack) -> "Namespace":
        """One that ends with the stack."""
        namespace = cls()
        stack.callback(namespace.end)
        return namespace

    @property
    def pid(self) -> int:
        return self._holder.pid

    @property
    def enter(self) -> list[str]:
        """The command prefix that runs a command in the namespace."""
        return ["nsenter", f"--net=/proc/{self.pid}/ns/net"]

    def run(self, *command: str) -> None:
        subprocess.run([*self.enter, *command], check=True)

    @contextmanager
    def inside(self) -> Iterator[None]:
        """Within the block, this thread and everything that it starts are in the namespace."""
        with open("/proc/thread-self/ns/net") as before, open(f"/proc/{self.pid}/ns/net") as here:
            _set(here.fileno())
            try:
                yield
            finally:
                _set(before.fileno())

    def end(self) -> None:
        assert self._holder.stdin is not None
        assert self._holder.stdout is not None
        self._holder.stdin.close()
        self._holder.wait(5)
        self._holder.stdout.close()


class Cable:
    """Two namespaces, `kiosk` and `robot`, connected by a cable."""

    def __init__(self) -> None:
        with ExitStack() as stack:
            self.kiosk, self._middle, self.robot = (Namespace.begun(stack) for _ in range(3))
            self._plug(self.kiosk, "kiosk", KIOSK_IP)
            self._plug(self.robot, "robot", ROBOT_IP)
            self._wire = subprocess.Popen(
                [*self._middle.enter, sys.executable, str(Path(__file__).with_name("wire.py")),
                 "to-kiosk", "to-robot"], stdin=subprocess.PIPE, text=True,
            )  # fmt: skip
            stack.callback(self._end_wire)
            self._stack = stack.pop_all()

    def _plug(self, side: Namespace, name: str, ip: str) -> None:
        there = ["peer", "name", "eth0", "netns", str(side.pid)]
        self._middle.run("ip", "link", "add", f"to-{name}", "type", "veth", *there)
        self._middle.run("ip", "link", "set", f"to-{name}", "up")
        side.run("ip", "address", "add", f"{ip}/30", "dev", "eth0")
        with side.inside():
            for command in (ETHTOOL_STXCSUM, ETHTOOL_STSO, ETHTOOL_SGSO):
                _switch_off("eth0", command)
        side.run("ip", "link", "set", "eth0", "up")

    def _end_wire(self) -> None:
        assert self._wire.stdin is not None
        self._wire.stdin.close()
        assert self._wire.wait(5) == 0, "the wire broke by itself"

    def cut(self) -> None:
        """Takes the kiosk's link down; frames in flight are lost."""
        self._middle.run("ip", "link", "set", "to-kiosk", "down")

    def restore(self) -> None:
        self._middle.run("ip", "link", "set", "to-kiosk", "up")

    def impair(self, *, delay_s: float = 0.0, loss: float = 0.0) -> None:
        """Delays each frame by `delay_s` each way, and drops the fraction `loss`, from now on."""
        assert self._wire.stdin is not None
        self._wire.stdin.write(json.dumps({"delay_s": delay_s, "loss": loss}) + "\n")
        self._wire.stdin.flush()

    def end(self) -> None:
        self._stack.close()


class Ring:
    """Three namespaces, `panel`, `first` and `second`, each two with a cable of their own."""

    FIRST: Final = "10.98.1.2"  # as the panel reaches it
    SECOND: Final = "10.98.2.2"
    BETWEEN: Final = "10.98.3.2"  # the first one, as the second reaches it

    def __init__(self) -> None:
        with ExitStack() as stack:
            self.panel, self.first, self.second = (Namespace.begun(stack) for _ in range(3))
            self._plug((self.panel, "to-first", "10.98.1.1"), (self.first, "to-panel", self.FIRST))
            self._plug((self.panel, "to-second", "10.98.2.1"), (self.second, "to-panel", self.SECOND))
            self._plug((self.second, "to-first", "10.98.3.1"), (self.first, "to-second", self.BETWEEN))
            self._stack = stack.pop_all()

    @staticmethod
    def _plug(near: tuple[Namespace, str, str], far: tuple[Namespace, str, str]) -> None:
        peer = ("peer", "name", far[1], "netns", str(far[0].pid))
        near[0].run("ip", "link", "add", near[1], "type", "veth", *peer)
        for side, interface, ip in (near, far):
            side.run("ip", "address", "add", f"{ip}/30", "dev", interface)
            side.run("ip", "link", "set", interface, "up")

    def cut(self) -> None:
        """Pulls the cable between the panel and the first corner."""
        self.first.run("ip", "link", "set", "to-panel", "down")

    def plug(self) -> None:
        self.first.run("ip", "link", "set", "to-panel", "up")

    def end(self) -> None:
        self._stack.close()


def _set(namespace: int) -> None:
    libc: Any = ctypes.CDLL(None, use_errno=True)
    if libc.setns(namespace, CLONE_NEWNET) != 0:
        raise OSError(ctypes.get_errno(), "setns")


def _switch_off(interface: str, command: int) -> None:
    value = ctypes.create_string_buffer(struct.pack("II", command, 0))
    request = struct.pack("16sP8x", interface.encode(), ctypes.addressof(value))
    with socket.socket() as any_socket:
        fcntl.ioctl(any_socket, SIOCETHTOOL, request)

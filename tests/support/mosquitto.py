"""A real broker, mosquitto of Debian, and what a client of it receives."""

import importlib
import json
import os
import subprocess
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from tests.support.certificates import Certificates
from tests.support.parts import free_port, until

MOSQUITTO: Final = "/usr/sbin/mosquitto"


class Broker:
    """A broker on a port of this machine, from `start` to `end`; with a name and a password it takes
    no other clients. With certificates it has a second port, `tls_port`."""

    def __init__(
        self,
        folder: Path,
        user: str = "",
        password: str = "",
        certificates: Certificates | None = None,
    ) -> None:
        self.port = free_port()
        self.tls_port = free_port()
        self._configuration = folder / "mosquitto.conf"
        lines = [f"listener {self.port} 127.0.0.1", f"allow_anonymous {'false' if user else 'true'}"]
        if user:
            users = folder / "users"
            subprocess.run(
                ["mosquitto_passwd", "-c", "-b", str(users), user, password],
                check=True,
                capture_output=True,
            )
            lines.append(f"password_file {users}")
        if certificates is not None:
            lines += [
                f"listener {self.tls_port} 127.0.0.1",
                f"certfile {certificates.server}",
                f"keyfile {certificates.key}",
            ]
        if os.geteuid() == 0:
            lines.append("user root")  # else it becomes another, which can't read the folder
        self._configuration.write_text("\n".join(lines) + "\n")
        self._process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        self._process = subprocess.Popen(
            [MOSQUITTO, "-c", str(self._configuration)],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )

    def end(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.wait()


class Listener:
    """What a client receives below a topic: the messages of each, as JSON or text."""

    def __init__(self, port: int, prefix: str, user: str = "", password: str = "") -> None:
        self.received: dict[str, list[Any]] = defaultdict(list)
        self._prefix = prefix
        mqtt: Any = importlib.import_module("paho.mqtt.client")
        self._client = mqtt.Client(mqtt.CallbackAPIVersion.VERSION2)
        if user:
            self._client.username_pw_set(user, password)
        self._client.on_connect = lambda client, *_: client.subscribe(f"{prefix}/#", qos=1)
        self._client.on_message = self._message
        self._client.connect_async("127.0.0.1", port)
        self._client.reconnect_delay_set(1, 1)
        self._client.loop_start()

    def _message(self, _: object, __: object, message: Any) -> None:
        text = message.payload.decode()
        content = json.loads(text) if text.startswith("{") else text
        self.received[message.topic.removeprefix(f"{self._prefix}/")].append(content)

    def newest(self, name: str) -> Any:
        return self.received[name][-1] if self.received[name] else None

    def close(self) -> None:
        self._client.disconnect()
        self._client.loop_stop()


@contextmanager
def listening(port: int, prefix: str, user: str = "", password: str = "") -> Iterator[Listener]:
    listener = Listener(port, prefix, user, password)
    try:
        yield listener
    finally:
        listener.close()


def stands(listener: Listener, *alarms: str) -> None:
    """Waits until the standing list has exactly these alarms."""

    def is_there() -> bool:
        newest = listener.newest("standing") or {"alarms": [{"id": "none yet"}]}
        return {alarm["id"] for alarm in newest["alarms"]} == set(alarms)

    until(is_there, f"{alarms} stand")

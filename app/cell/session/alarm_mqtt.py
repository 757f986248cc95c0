"""Publishes alarms by MQTT, on a thread of its own: each transition, and the standing list, which is
retained. The event loop only hands over what is new, and never waits.

Transitions wait in a bounded queue while there is no connection. The oldest are dropped and counted; of
the standing list only the newest waits."""

import importlib
import json
import logging
import os
import ssl
import sys
import threading
import time
from collections import deque
from collections.abc import Iterable, Mapping
from datetime import datetime
from itertools import islice
from pathlib import Path
from typing import Any, Final

from app.cell.alarms.history import HistoryRow
from app.cell.alarms.records import finite, transition
from app.cell.alarms.shown import MAX_ROWS, AlarmRow
from app.panel.alarm import MqttRules
from app.system.texts import localized

log = logging.getLogger("kiosk.alarms")

MOST_TRANSITIONS: Final = 1000  # that wait
AT_ONCE: Final = 50
ANSWERED_WITHIN_S: Final = 5.0  # by the broker; then they are sent again
STANDING_EVERY_S: Final = 0.5
KEEPALIVE_S: Final = 15
RECONNECT_S: Final = (1, 30)  # the first pause, and the longest
ENDS_WITHIN_S: Final = 2.0
NOT_IN_HISTORY: Final = ("seq", "clock_back_s")  # are of the file


class AlarmMqtt:
    """The publisher, from `start` to `stop`; a panel without `[alarms.mqtt]` publishes nothing. `state`
    is "connected", or why it is not, `since` (seconds since the epoch). `last_error` is the last reason
    why there was no connection, "" for none."""

    def __init__(self, rules: MqttRules | None, language: str) -> None:
        self._rules = rules
        self._language = language
        self._wake = threading.Event()
        self._transitions: deque[HistoryRow] = deque()
        self._sending: list[HistoryRow] = []  # on the thread
        self._lock = threading.Lock()  # of the next two; never held for long
        self._standing: tuple[AlarmRow, ...] = ()
        self._is_new = False  # the standing list is not published yet
        self._greet = False  # a connection is new: the broker has no state of this one
        self._stopped = False
        self._thread: threading.Thread | None = None
        self.is_connected = False
        self.state = "not connected"
        self.since = 0.0
        self.last_error = ""
        self.published = 0
        self.dropped = 0

    @property
    def address(self) -> str:
        """Of the broker; "" for none."""
        return f"{self._rules.host}:{self._rules.used_port}" if self._rules else ""

    @property
    def waiting(self) -> int:
        """Transitions that the broker does not have yet."""
        return len(self._transitions) + len(self._sending)

    # On the event loop.

    def start(self) -> None:
        if self._rules is None:
            return
        self._thread = threading.Thread(
            target=self._run, args=(self._rules,), name="alarm-mqtt", daemon=True
        )
        self._thread.start()

    def put(self, row: HistoryRow) -> None:
        """Hands over a transition."""
        if self._rules is None:
            return
        if len(self._transitions) >= MOST_TRANSITIONS:
            self._transitions.popleft()
            self.dropped += 1
        self._transitions.append(row)
        self._wake.set()

    def put_standing(self, rows: Iterable[AlarmRow]) -> None:
        """Hands over the standing list in place of the last one: as many rows as pages list."""
        if self._rules is None:
            return
        first = tuple(islice(rows, MAX_ROWS))
        with self._lock:
            self._standing, self._is_new = first, True
        self._wake.set()

    def stop(self) -> None:
        """Ends the connection; a broker then has that the panel is offline. At most `ENDS_WITHIN_S`."""
        self._stopped = True
        self._wake.set()
        if self._thread is not None:
            self._thread.join(ENDS_WITHIN_S)

    # On the thread.

    def _run(self, rules: MqttRules) -> None:
        try:
            client = self._connect(rules)
        except ImportError:
            self._lost("paho-mqtt is not installed: pip install 'operator-panel[mqtt]'")
            return
        except (OSError, ValueError) as error:
            self._lost(str(error))
            return
        while not self._stopped:
            self._wake.wait(STANDING_EVERY_S)
            self._wake.clear()
            try:
                self._publish(client, rules.prefix)
            except Exception:
                log.exception("alarms could not be published by MQTT")
                time.sleep(STANDING_EVERY_S)
            time.sleep(0.02)  # changes that come together are published together
        self._end(client, rules.prefix)

    def _publish(self, client: Any, prefix: str) -> None:
        if not self.is_connected:
            return
        if self._greet:
            self._greet = False
            client.publish(f"{prefix}/state", "online", qos=1, retain=True)
            self._is_new = True
        while self.is_connected and (self._sending or self._transitions) and not self._stopped:
            while self._transitions and len(self._sending) < AT_ONCE:
                self._sending.append(self._transitions.popleft())
            texts = [self._json(_published_fields(row)) for row in self._sending]
            if not self._send(client, [(f"{prefix}/transitions", text) for text in texts]):
                return
            self.published += len(self._sending)
            self._sending.clear()
        with self._lock:
            rows, is_new, self._is_new = self._standing, self._is_new, False
        if not is_new:
            return
        content = {"at": _now(), "alarms": [finite(row) for row in rows]}
        topic = f"{prefix}/standing"
        if not self._send(client, [(topic, self._json(content))], retain=True):
            self._is_new = True

    def _send(self, client: Any, messages: list[tuple[str, str]], retain: bool = False) -> bool:
        """Publishes messages in their order; whether the broker has all."""
        waiting = [client.publish(topic, text, qos=1, retain=retain) for topic, text in messages]
        end = time.monotonic() + ANSWERED_WITHIN_S
        try:
            for info in waiting:
                while not info.is_published():
                    if time.monotonic() > end or not self.is_connected or self._stopped:
                        return False
                    info.wait_for_publish(0.1)
        except (RuntimeError, ValueError):  # it has no room for more, or no connection
            return False
        return True

    def _json(self, content: Mapping[str, Any]) -> str:
        return json.dumps(localized(content, self._language), ensure_ascii=False)

    def _connect(self, rules: MqttRules) -> Any:
        """The client, which connects and reconnects on a thread of its own."""
        mqtt: Any = importlib.import_module("paho.mqtt.client")
        client = mqtt.Client(mqtt.CallbackAPIVersion.VERSION2, client_id=rules.client_id or "")
        if rules.username is not None:
            client.username_pw_set(rules.username, _password(rules))
        if rules.tls:
            client.tls_set(ca_certs=str(rules.ca) if rules.ca else None)
        client.will_set(f"{rules.prefix}/state", "offline", qos=1, retain=True)
        client.max_queued_messages_set(4 * AT_ONCE)
        client.reconnect_delay_set(*RECONNECT_S)
        client.on_connect = self._connected
        client.on_disconnect = self._disconnected
        client.on_connect_fail = lambda *_: self._lost(_why(sys.exc_info()[1]))
        client.connect_async(rules.host, rules.used_port, KEEPALIVE_S)
        client.loop_start()
        return client

    def _connected(self, client: Any, data: Any, flags: Any, reason: Any, properties: Any) -> None:
        if reason.is_failure:
            self._lost(str(reason))
            return
        self._greet = self.is_connected = True
        self._say("connected")
        self._wake.set()

    def _disconnected(self, client: Any, data: Any, flags: Any, reason: Any, properties: Any) -> None:
        self._lost(str(reason))

    def _lost(self, reason: str) -> None:
        self.is_connected = False
        self.last_error = reason
        self._say(reason)

    def _say(self, state: str) -> None:
        if state != self.state:
            log.info("alarms by MQTT to %s: %s", self.address, state)
            self.state, self.since = state, time.time()

    def _end(self, client: Any, prefix: str) -> None:
        if self.is_connected:
            info = client.publish(f"{prefix}/state", "offline", qos=1, retain=True)
            try:
                info.wait_for_publish(1.0)
            except (RuntimeError, ValueError):
                log.info("the panel's end could not be sent to the broker of alarms")
        client.disconnect()
        client.loop_stop()


def _why(error: BaseException | None) -> str:
    """Why a connection was not made, by the error that paho-mqtt handles then."""
    if isinstance(error, ssl.SSLCertVerificationError):
        return f"the broker's certificate is not trusted: {error.verify_message}"
    if isinstance(error, OSError):
        return error.strerror or str(error) or "no connection"
    return "no connection"


def _password(rules: MqttRules) -> str | None:
    """OSError or ValueError if it is not where the panel file says."""
    if rules.password_env is not None and rules.password_env in os.environ:
        return os.environ[rules.password_env]
    if rules.password_file is not None:
        return Path(rules.password_file).read_text(encoding="utf-8").strip()
    if rules.password_env is not None:
        raise ValueError(f"the environment variable {rules.password_env} is not set")
    return None


def _published_fields(row: HistoryRow) -> dict[str, Any]:
    return {key: value for key, value in transition(row).items() if key not in NOT_IN_HISTORY}


def _now() -> str:
    return datetime.now().astimezone().isoformat(timespec="milliseconds")

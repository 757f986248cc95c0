"""Continuous numbered presses during a fault, and the checks of their results."""

import itertools
import json
import secrets
import threading
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import httpx

from tests.support.parts import ENOUGH_S, Server, http_client, until

PERIOD_S: Final = 0.03
TWICE_EACH: Final = 5  # every fifth press is posted a second time, with the same id
SETTLE_S: Final = ENOUGH_S

_runs = itertools.count()
_this = secrets.token_hex(3)


@dataclass(slots=True)
class Press:
    """One press; `outcome` is "" before its response. Times are monotonic seconds."""

    text: str
    at: float
    answered_at: float = 0.0
    outcome: str = ""
    reason: str = ""


class Presser:
    """Presses a widget continuously, each time with a unique text."""

    def __init__(self, server: Server, widget: str, period_s: float = PERIOD_S) -> None:
        self.presses: list[Press] = []
        self._server = server
        self._widget = widget
        self._period_s = period_s
        self._run = f"{_this}{next(_runs)}"
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._press_on, daemon=True)
        self._thread.start()

    def _press_on(self) -> None:
        with http_client(self._server.url, 10) as http:
            while not self._over.wait(self._period_s):
                self._press(http, len(self.presses))

    def _press(self, http: httpx.Client, number: int) -> None:
        text = f"{self._run}-{number}"
        press = Press(text, time.monotonic())
        self.presses.append(press)
        body = {"inputs": {"message": text}, "id": text}
        for _ in range(2 if number % TWICE_EACH == 0 else 1):
            try:
                answer = http.post(f"{self._server.base}/widgets/{self._widget}", json=body)
                receipt = answer.json()
            except (httpx.HTTPError, json.JSONDecodeError):
                return  # the result is unknown, and it is not repeated
            if not press.outcome:
                press.outcome, press.reason = receipt["outcome"], receipt["reason"]
                press.answered_at = time.monotonic()

    def end(self) -> list[Press]:
        self._over.set()
        self._thread.join(15)
        return self.presses

    def count(self, outcome: str, since: float = 0.0) -> int:
        return sum(p.outcome == outcome and p.at >= since for p in self.presses)

    def wait_for(
        self, outcome: str = "published", since: float = 0.0, within_s: float = ENOUGH_S
    ) -> None:
        """Waits until a press made after `since` has this outcome."""
        until(
            lambda: self.count(outcome, since), f"a press is {outcome}: {self.presses[-1:]}", within_s
        )


@dataclass(frozen=True, slots=True)
class Account:
    """The counts of a series of presses."""

    pressed: int
    received: int
    refused: int
    unknown: int  # with a receipt that says so
    latest_s: float

    def __str__(self) -> str:
        counts = f"{self.pressed} pressed, {self.refused} refused, {self.received} received"
        return f"{counts}, {self.unknown} unknown" if self.unknown else counts


Arrivals = Callable[[], Sequence[tuple[float, str]]]


def accounted(
    presses: Sequence[Press], arrivals: Arrivals, whole: Callable[[Press], bool], late_s: float
) -> Account:
    """Waits for presses in flight, then checks that none was received twice, late or after a refusal,
    and that each press with the outcome `published` was received if the link was intact (`whole`)."""
    by_text = {press.text: press for press in presses}
    expected = {p.text for p in presses if p.outcome == "published" and whole(p)}

    def mine() -> list[tuple[float, str]]:
        return [(at, text) for at, text in arrivals() if text in by_text]

    try:
        until(lambda: expected <= {text for _, text in mine()}, "", SETTLE_S, every_s=0.2)
    except AssertionError:
        lost = sorted(expected - {text for _, text in mine()})
        raise AssertionError(f"published, but not received: {[by_text[t] for t in lost[:5]]}") from None
    came = mine()
    twice = [text for text, times in Counter(text for _, text in came).items() if times > 1]
    assert not twice, f"received twice: {[by_text[t] for t in twice[:5]]}"
    refused_ones = [by_text[text] for _, text in came if by_text[text].outcome == "refused"]
    assert not refused_ones, f"refused, but received: {refused_ones[:5]}"
    latest = max((at - by_text[text].at for at, text in came), default=0.0)
    assert latest <= late_s, f"received {latest:.2f} s after its press"
    refused, unknown = (
        sum(p.outcome == outcome for p in presses) for outcome in ("refused", "unknown")
    )
    return Account(len(presses), len(came), refused, unknown, latest)

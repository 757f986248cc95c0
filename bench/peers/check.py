"""Checks a peer before it is measured: its page shows the robot's state, and the robot receives
presses."""

import math
import time
from collections.abc import Callable
from typing import Any, Final

from playwright.sync_api import Page

from bench.peer import Peer, Running
from tests.support.parts import until

FOUND_WITHIN_S: Final = 20.0  # for discovery and loading
THEN_WITHIN_S: Final = 3.0
AGAIN_S: Final = 0.5

Robot = Callable[..., Any]  # commands of `bench/robot.py`: robot("enable", way=…, value=…)


def fault_of(peer: Peer, running: Running, topics: tuple[str, ...], robot: Robot, page: Page) -> str:
    """What does not work in a running peer, "" if everything works. `page` is a new page."""
    try:
        page.goto(running.url)
        _follows(peer, robot, page)
        if topics:
            _shows(peer, topics, robot, page)
        if peer.button:
            _presses(peer, robot, page)
    except Exception as fault:  # any error excludes only this peer
        return f"{peer.title}: {fault}"
    return ""


def _follows(peer: Peer, robot: Robot, page: Page) -> None:
    """The first values may be published too early for the peer, so they are repeated; later ones are
    not."""

    def shows(value: bool) -> bool:
        return page.locator(peer.shown).first.is_enabled() == value

    def says(value: bool) -> Callable[[], None]:
        return lambda: robot("enable", way=peer.robot, value=value)

    _done(says(False), lambda: shows(False), "its page is loaded", again_s=AGAIN_S)
    _done(says(True), lambda: shows(True), "its button is opened", again_s=AGAIN_S)
    _done(says(False), lambda: shows(False), "its button is locked")
    _done(says(True), lambda: shows(True), "its button is opened again")


def _shows(peer: Peer, topics: tuple[str, ...], robot: Robot, page: Page) -> None:
    shown = page.locator(",".join(f'[data-topic="{topic}"]' for topic in topics))
    robot("load", ways=[peer.robot], topics=list(topics), hz=10, size=12)
    try:
        until(
            lambda: sum(text.startswith("#") for text in shown.all_inner_texts()) == len(topics),
            "all topics are shown",
            FOUND_WITHIN_S,
        )
    finally:
        robot("quiet")


def _presses(peer: Peer, robot: Robot, page: Page) -> None:
    """The first press may come too early for the robot; the second must be received once."""
    button = page.locator(peer.button).first
    heard: list[str] = []

    def has_heard(text: str) -> bool:
        heard.extend(said for _, said in robot("heard", way=peer.robot))
        return text in heard

    page.locator("#text").fill("first")
    _done(button.click, lambda: has_heard("first"), "the robot hears a press", again_s=AGAIN_S)
    page.locator("#text").fill("second")
    _done(button.click, lambda: has_heard("second"), "the robot hears the second press")
    assert heard.count("second") == 1, f"the robot heard one press {heard.count('second')} times"


def _done(
    do: Callable[[], object], effect: Callable[[], bool], goal: str, again_s: float = math.inf
) -> None:
    """Acts, again every `again_s`, until the effect is seen."""
    due = 0.0

    def look() -> bool:
        nonlocal due
        if time.monotonic() >= due:
            due = time.monotonic() + again_s
            do()
        return effect()

    until(look, goal, THEN_WITHIN_S if math.isinf(again_s) else FOUND_WITHIN_S)

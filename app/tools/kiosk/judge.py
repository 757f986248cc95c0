"""What to do about what the screen shows. Pure: looks and times in, an action out."""

from dataclasses import dataclass
from enum import Enum
from typing import Final

# A page that is silent while the server answers: its own reconnection takes less.
SILENT_AFTER_S: Final = 5.0
# A page of this server that is none of the panel's, such as an error's plain text.
FOREIGN_AFTER_S: Final = 5.0
# A page that is visible and draws no frame.
UNDRAWN_AFTER_S: Final = 5.0
# A page that is opened again this often within this time needs a new browser.
MOST_OPENED: Final = 3
OPENED_WITHIN_S: Final = 30.0
# A page that stays silent whatever is done: not restarted more often than this.
LONGEST_PAUSE_S: Final = 300.0


class Action(Enum):
    NONE = "none"
    OPEN_PANEL = "open the panel"
    OPEN_WAITING = "open the waiting page"
    RESTART = "restart the browser"


@dataclass(frozen=True, slots=True, kw_only=True)
class PageStatus:
    """What was seen of the page. `age_s` is the age of its last event, None if it has no stream."""

    responds: bool = True
    crashed: bool = False
    waiting: bool = False
    on_panel: bool = False
    ours: bool = False
    age_s: float | None = None
    drawn: bool = True


@dataclass(frozen=True, slots=True)
class PageDecision:
    action: Action
    reason: str = ""


GOOD: Final = PageDecision(Action.NONE)


class Judge:
    """Judges one look after another."""

    def __init__(self) -> None:
        self._since: dict[str, float] = {}
        self._opened: list[float] = []
        self._pause_s = SILENT_AFTER_S
        self._silent_before = -LONGEST_PAUSE_S

    def judge(self, look: PageStatus, server_answers: bool | None, now: float) -> PageDecision:
        """`server_answers` is None if it was not queried: a page with young events shows that it does.
        `now` is in seconds of a monotonic clock."""
        verdict = self._judge(look, server_answers, now)
        if verdict.action is Action.OPEN_PANEL and not look.waiting:
            self._opened = [at for at in self._opened if now - at < OPENED_WITHIN_S] + [now]
            if len(self._opened) > MOST_OPENED:
                verdict = PageDecision(Action.RESTART, f"{verdict.reason}, again and again")
        if verdict.action is Action.RESTART:
            self._since.clear()
            self._opened.clear()
        return verdict

    def _judge(self, look: PageStatus, server: bool | None, now: float) -> PageDecision:
        opened = Action.OPEN_WAITING if server is False else Action.OPEN_PANEL
        if look.crashed:
            return PageDecision(opened, "the page crashed")
        if not look.responds:
            return PageDecision(Action.RESTART, "the page did not respond")
        if self._lasts("undrawn", not look.drawn, UNDRAWN_AFTER_S, now):
            return PageDecision(Action.RESTART, f"the page drew nothing for {UNDRAWN_AFTER_S:g} s")
        if look.waiting:
            return PageDecision(Action.OPEN_PANEL, "the server answers") if server else GOOD
        if not look.on_panel:
            return PageDecision(opened, "another page is shown")
        if self._lasts("foreign", not look.ours, FOREIGN_AFTER_S, now):
            self._since.pop("foreign")
            return PageDecision(opened, "no page of the panel is shown")
        return self._silence(look, server, now)

    def _silence(self, look: PageStatus, server: bool | None, now: float) -> PageDecision:
        """A page whose events are old while the server answers is opened again, then the browser
        restarted, each time after a longer pause."""
        if look.age_s is not None and look.age_s < SILENT_AFTER_S:
            self._since.pop("silent", None)
            if now - self._silent_before > LONGEST_PAUSE_S:
                self._pause_s = SILENT_AFTER_S
            return GOOD
        silent = look.ours and look.age_s is not None and server is True
        if not self._lasts("silent", silent, self._pause_s, now):
            return GOOD
        self._since.pop("silent")
        again = now - self._silent_before < 4 * self._pause_s
        self._silent_before = now
        self._pause_s = min(2 * self._pause_s, LONGEST_PAUSE_S)
        action = Action.RESTART if again else Action.OPEN_PANEL
        return PageDecision(action, "the page has no events though the server answers")

    def _lasts(self, condition: str, holds: bool, for_s: float, now: float) -> bool:
        """Whether `condition` has held for `for_s` seconds or longer."""
        if not holds:
            self._since.pop(condition, None)
            return False
        return now - self._since.setdefault(condition, now) >= for_s

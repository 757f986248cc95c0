"""The live proof: guided steps at a real robot, each with what the panel measured and the word of the
person who watches. It presses nothing by itself."""

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import Final

from app.panel.model import Panel
from app.panel.robot_panels import panel_of
from app.panel.roles import ENGINEER
from app.system.errors import KioskError
from app.system.printable import readable
from app.system.texts import render
from app.tools.editor.kiosk_client import KioskClient
from app.tools.prove.answers import Answer, AnswersFile, Word, now_text
from app.tools.prove.cases import plan_of
from app.tools.prove.measures import Measure
from app.tools.prove.result import NOT_REACHED, Proof, Result
from app.tools.prove.steps import AT_THE_END, Row, Step, steps_of
from app.tools.prove.terminal import Terminal
from app.tools.prove.watch import PanelWatch

LOOK_S: Final = 0.1
LOG_WITHIN_S: Final = 5.0
LONGEST_NAME, LONGEST_REMARK = 60, 500
MOST_LINES: Final = 8  # of a step; more cases are counted
WORDS: Final[dict[str, Word]] = {"t": "tick", "x": "cross", "s": "skip"}
KEYS: Final = "[t] it is so  [x] it is not  [r] remark  [s] skip  [b] back  [?] again  [q] stop for now"


@dataclass(frozen=True)
class Watched:
    """A robot of the panel: its panel, its watch, that of a client without a role, and its steps."""

    panel: Panel
    watch: PanelWatch
    stranger: PanelWatch | None
    steps: Sequence[Step]
    robot: str = ""


@contextmanager
def watched_robots(
    address: str, token: str | None, trust: str, panel: Panel
) -> Iterator[Sequence[Watched]]:
    """The robots of the panel at an address, watched until the end of the block. KioskError if it can't
    be reached, shows another panel file, or the token is not an engineer's."""
    client = KioskClient(address, token, trust)
    session = client.session()
    if session.get("role") != ENGINEER:
        raise KioskError(
            "an engineer's token is needed: to all others the panel shows some controls as locked"
            " (--token-file)"
        )
    has_users = bool(session.get("users"))
    with ExitStack() as stack:

        def watch(own: KioskClient, robot: str, name: str, *, reads_log: bool) -> PanelWatch:
            made = PanelWatch(own, robot, name, reads_log=reads_log)
            stack.callback(made.close)
            made.start()
            return made

        robots = []
        for entry in panel.robots or (None,):
            robot, name = (str(entry.id), render(entry.name)) if entry else ("", "")
            own = panel_of(panel, robot or None)
            watching = watch(client, robot, name, reads_log=True)
            served = watching.shown.revision.partition("-")[0]
            if served != panel.revision:
                raise KioskError(
                    f"the server shows another panel file: {served}…, and this is {panel.revision}…"
                )
            outside = KioskClient(address, None, trust)
            stranger = watch(outside, robot, name, reads_log=False) if has_users else None
            steps = [*steps_of(own, plan_of(own, robot), has_users=has_users)]
            robots.append(Watched(own, watching, stranger, steps, robot))
        yield robots


class LiveProof:
    """The steps of all robots with a person at a terminal."""

    def __init__(
        self, robots: Sequence[Watched], answers: AnswersFile, terminal: Terminal, by: str
    ) -> None:
        """`by` is the person who watches."""
        self._steps = [(watched, step) for watched in robots for step in watched.steps]
        self._answers = answers
        self._terminal = terminal
        self._by = by

    def run(self) -> None:
        """Until each step has an answer. EOFError or KeyboardInterrupt where the person stops for now;
        KioskError if the server has another panel file, or an answer can't be kept."""
        open_steps = [n for n in range(len(self._steps)) if self._answer(n) is None]
        if len(open_steps) < len(self._steps):
            self._terminal.say(
                f"{len(self._steps) - len(open_steps)} of {len(self._steps)} steps are done."
            )
        number = open_steps[0] if open_steps else len(self._steps)
        while number < len(self._steps):
            if self._step(number):
                number = next(
                    (n for n in range(number + 1, len(self._steps)) if self._answer(n) is None),
                    len(self._steps),
                )
            else:
                number = max(0, number - 1)

    def proof(self) -> Proof:
        """The result so far."""
        proof = Proof(kind="live")
        for number, (watched, step) in enumerate(self._steps):
            answer = self._answer(number)
            if answer is None:
                proof.missing += 1
            if answer is None or answer.word == "skip":
                why = NOT_REACHED if answer is None else f"skipped by {answer.by}: {answer.remark}"
                proof.left_out[_key(watched, step)] = why
            else:
                proof.results += [Result(**row) for row in answer.rows]
        proof.left_out["the end of the server"] = AT_THE_END
        return proof

    def _answer(self, number: int) -> Answer | None:
        return self._answers.get(_key(*self._steps[number]))

    def _step(self, number: int) -> bool:
        """A step until it has its answer; False for a wish to go back to the one before."""
        watched, step = self._steps[number]
        watched.watch.begin()
        measures = [_measure(watched, row) for row in step.rows]
        told: dict[str, str] = {}
        remark, doubted = "", False
        self._show(number)
        while True:
            self._check_panel(watched)
            for measure in measures:
                measure.look()
            told = self._tell(watched, measures, told)
            key = self._terminal.key(LOOK_S)
            if key == "q":
                raise EOFError
            if key == "b":
                return False
            if key == "?":
                self._show(number)
                told = {}
            elif key == "r":
                remark = self._remark("Remark: ")
            elif key in WORDS and watched.watch.lost and key != "s":
                self._terminal.say(
                    "  Not now: the panel's server can't be read, so nothing is measured."
                )
            elif key in WORDS:
                word = WORDS[key]
                if word == "tick" and not doubted and (lacks := _lacks(measures)):
                    doubted = True
                    self._terminal.say(
                        f"  The panel has not shown it: {lacks}. [t] again keeps it as a fault."
                    )
                    continue
                if word != "tick" and not remark:
                    remark = self._remark("Why not: ")
                    if not remark:
                        continue
                self._keep(watched, step, measures, word, remark)
                return True

    def _show(self, number: int) -> None:
        watched, step = self._steps[number]
        robot = f", robot {watched.robot}" if watched.robot else ""
        names = ", ".join(row.name for row in step.rows[:MOST_LINES])
        more = len(step.rows) - MOST_LINES
        self._terminal.say(
            f"\nStep {number + 1} of {len(self._steps)}{robot}: {step.title}\n  do:    {step.do}\n"
            f"  must:  {step.must}\n  for:   {names}{f' and {more} more' if more > 0 else ''}\n  {KEYS}"
        )

    def _check_panel(self, watched: Watched) -> None:
        served = watched.watch.shown.revision.partition("-")[0]
        if served and served != watched.panel.revision:
            raise KioskError(
                f"the server shows another panel file now ({served}…, not"
                f" {watched.panel.revision}…): nothing of this step is kept. Continue when it shows"
                " the file of this proof again, or begin again with the new one"
            )

    def _tell(
        self, watched: Watched, measures: Sequence[Measure], told: dict[str, str]
    ) -> dict[str, str]:
        """Says what has changed of what the panel shows; returns what was said, by what it is about."""
        now = {"server": f"  server: {watched.watch.lost}" if watched.watch.lost else ""}
        met = [measure for measure in measures if measure.took_s is not None]
        if len(measures) <= MOST_LINES:
            now |= {measure.row.name: _line(measure) for measure in measures}
        else:
            now["met"] = f"  panel: {len(met)} of {len(measures)} are as they must be"
            if len(met) == len(measures):
                now["last"] = _line(max(met, key=lambda measure: measure.took_s or 0.0))
        for name, line in now.items():
            if line and told.get(name) != line:
                self._terminal.say(line)
        if told.get("server") and not now["server"]:
            self._terminal.say("  server: it answers again")
        return now

    def _remark(self, prompt: str) -> str:
        return readable(self._terminal.line(f"  {prompt}"))[:LONGEST_REMARK]

    def _keep(
        self, watched: Watched, step: Step, measures: Sequence[Measure], word: Word, remark: str
    ) -> None:
        at, rows = now_text(), []
        if word != "skip":
            if not watched.watch.has_read_log(LOG_WITHIN_S):
                remark = f"{remark} (the end of the log could not be read)".strip()
            for measure in measures:
                measure.look()
                fault = f"crossed: {remark}" if word == "cross" else measure.fault()
                rows.append(
                    Result(
                        *measure.row, fault=fault, took_s=measure.took_s, shown=measure.shown,
                        robot=watched.robot, by=self._by, at=at, remark=remark,
                    )._asdict()
                )  # fmt: skip
        answer = Answer(word=word, by=self._by, at=at, remark=remark, rows=rows)
        self._answers.keep(_key(watched, step), answer)
        faults = [row["fault"] for row in rows if row["fault"]]
        self._terminal.say(f"  kept: {word}{f', with {len(faults)} faults' if faults else ''}")


def _key(watched: Watched, step: Step) -> str:
    return f"{watched.robot}: {step.key}" if watched.robot else step.key


def _measure(watched: Watched, row: Row) -> Measure:
    return Measure(row, watched.panel, watched.watch, watched.stranger)


def _line(measure: Measure) -> str:
    took = f" ✓ after {measure.took_s:.1f} s" if measure.took_s is not None else ""
    return f"  panel: {measure.row.name}{took}: {measure.shown}" if measure.shown or took else ""


def _lacks(measures: Sequence[Measure]) -> str:
    """The cases that were not measured as they must be."""
    lacking = [measure for measure in measures if measure.took_s is None]
    named = [f"{m.row.name} {m.shown or 'nothing of it'}" for m in lacking[:MOST_LINES]]
    return "; ".join(named)


def watcher_name(chosen: str, terminal: Terminal) -> str:
    """The name of the person who watches: as given, else as typed. KioskError without one."""
    name = readable(chosen or terminal.line("Who watches? ")).strip()
    if not 0 < len(name) <= LONGEST_NAME:
        raise KioskError(f"who watches has a name, of at most {LONGEST_NAME} characters: --by NAME")
    return name

"""The robots of a running panel, as a live proof watches them."""

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager

from app.panel.model import Panel
from app.panel.robot_panels import panel_of
from app.panel.roles import ENGINEER
from app.system.errors import KioskError
from app.system.texts import render
from app.tools.editor.kiosk_client import KioskClient
from app.tools.prove.cases import plan_of
from app.tools.prove.live import Watched
from app.tools.prove.steps import steps_of
from app.tools.prove.watch import PanelWatch


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

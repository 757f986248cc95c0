"""All by which one robot is commanded: presses and holds, and what they are made of."""

import asyncio
from collections.abc import Callable
from typing import TYPE_CHECKING

from app.audit.press_record import PressLog
from app.commands.actions.goals import GoalTracker
from app.commands.actions.recovery import GoalRecovery
from app.commands.confirmations import Confirmations
from app.commands.dispatch import Dispatcher, Trackers
from app.commands.holds.controller import HoldController
from app.commands.holds.messages import HoldMessages
from app.commands.parameters.sync import ParameterSync
from app.commands.press_judge import Arrivals, PressJudge
from app.commands.presses import Presses
from app.commands.service_calls import ServiceCalls
from app.transport.peer import Peer, RobotContext

if TYPE_CHECKING:
    from app.recording import Recorder


class RobotCommands:
    """Opened by `start`, ended by `close` and `stop`; on the event loop only."""

    def __init__(
        self,
        context: RobotContext,
        peer: Peer,
        press_log: PressLog,
        recorder: "Recorder | None",
        take: Callable[[], None],
    ) -> None:
        """`take` takes in what has arrived from the robot, before anything is judged."""
        panel, interfaces, robot, link = context.panel, context.interfaces, context.robot, context.link
        changed = context.changed
        self.calls = ServiceCalls(interfaces, robot, link, changed)
        self.actions = GoalTracker(interfaces, robot, link, changed)
        self.confirmations = Confirmations(robot, changed)
        self.parameters = ParameterSync(panel, interfaces, robot, link, self.calls, changed)
        self._recovery = GoalRecovery(panel, robot, press_log, self.actions, changed)
        self.dispatcher = Dispatcher(
            panel,
            interfaces,
            robot,
            link,
            Trackers(self.calls, self.actions, self.confirmations, self.parameters),
            reached=peer.flushed,
        )
        latest = Arrivals(take, lambda: link.hurried)
        judge = PressJudge(panel, robot, latest)
        self.presses = Presses(judge, self.dispatcher, press_log, robot.name, recorder)
        self.holds = HoldController(
            panel,
            robot,
            HoldMessages(interfaces, robot, link, self.dispatcher.check_inputs),
            asyncio.get_running_loop(),
            latest,
            changed=changed,
            recorder=recorder,
        )

    async def start(self) -> None:
        """Before anything arrives: finds the goals that ran before the server's start."""
        await self._recovery.start()

    def on_graph_change(self) -> None:
        """After every change of the graph."""
        self.calls.on_graph_change()
        self.actions.on_graph_change()
        self.parameters.on_graph_change()

    def close(self) -> None:
        """Ends holds, while there is a way to say so to the robot, and presses."""
        self.holds.close()
        self.presses.close()

    async def stop(self) -> None:
        """Ends its tasks; goals go on in the robot."""
        await self._recovery.stop()
        await self.actions.stop()
        await self.parameters.stop()

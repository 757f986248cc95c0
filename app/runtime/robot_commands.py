"""Wires the commands of one robot: presses, holds and their trackers."""

import asyncio
from typing import TYPE_CHECKING

from app.audit.press_record import PressLog
from app.commands.actions.goals import GoalTracker
from app.commands.actions.recovery import GoalRecovery
from app.commands.confirmations import Confirmations
from app.commands.dispatch import Dispatcher, Trackers
from app.commands.holds.controller import HoldController
from app.commands.holds.messages import HoldMessages
from app.commands.option_lists import OptionLists
from app.commands.parameters.sync import ParameterSync
from app.commands.press_guard import PressGuard
from app.commands.press_judge import PendingSamples, PressJudge
from app.commands.presses import Presses
from app.commands.recipe_loads import Books, RecipeLoader
from app.commands.service_calls import ServiceCalls
from app.robot.sample_handlers import SampleHandlers
from app.transport.peer import Peer, RobotContext

if TYPE_CHECKING:
    from app.recording import Recorder


class RobotCommands:
    """The commands of one robot, opened by `start`, ended by `close` and `stop`. Used on the event loop
    only."""

    def __init__(
        self,
        context: RobotContext,
        peer: Peer,
        press_guard: PressGuard,
        press_log: PressLog,
        recorder: "Recorder | None",
        books: Books,
    ) -> None:
        panel, interfaces, robot, link = context.panel, context.interfaces, context.robot, context.link
        changed = context.signals.changed.emit
        self.recorder = recorder
        self.calls = ServiceCalls(interfaces, robot, link, changed)
        self.actions = GoalTracker(interfaces, robot, link, changed)
        self.confirmations = Confirmations(robot, changed)
        self.parameters = ParameterSync(panel, interfaces, robot, link, self.calls, changed)
        self.option_lists = OptionLists(panel, interfaces, robot, link, changed)
        self.sample_handlers = SampleHandlers()
        self.actions.register(self.sample_handlers, panel.actions())
        self.confirmations.register(self.sample_handlers, panel.confirmations())
        self.parameters.register(self.sample_handlers)
        self._recovery = GoalRecovery(panel, robot, press_log, self.actions, changed)
        self.dispatcher = Dispatcher(
            panel,
            interfaces,
            robot,
            link,
            Trackers(
                self.calls,
                self.actions,
                self.confirmations,
                self.parameters,
                RecipeLoader(interfaces, robot, self.parameters, books, changed),
            ),
            flushed=peer.flushed,
        )
        arrivals = PendingSamples(
            context.signals.judging.emit,
            lambda: any(each.has_immediate for each in (link, *context.awaited)),
        )
        judge = PressJudge(panel, robot, press_guard, arrivals)
        self.presses = Presses(judge, self.dispatcher, press_log, robot.name, recorder)
        self.holds = HoldController(
            panel,
            robot,
            judge,
            HoldMessages(interfaces, robot, link, self.dispatcher.check_inputs),
            asyncio.get_running_loop(),
            changed=changed,
            recorder=recorder,
        )

    async def start(self) -> None:
        """Resumes goals that were sent before the server's start. Call it before anything arrives."""
        await self._recovery.start()

    def on_graph_change(self) -> None:
        """Call it after every change of the graph."""
        self.calls.on_graph_change()
        self.actions.on_graph_change()
        self.parameters.on_graph_change()
        self.option_lists.on_graph_change()

    def close(self) -> None:
        """Ends holds, while their stop messages can still be sent, and refuses presses."""
        self.holds.close()
        self.presses.close()

    async def stop(self) -> None:
        """Ends the tasks. Goals continue on the robot."""
        await self._recovery.stop()
        await self.actions.stop()
        await self.parameters.stop()
        await self.option_lists.stop()

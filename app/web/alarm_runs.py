"""Acts on alarms for one request: the act, then the command that its acknowledgement sends."""

import asyncio
import secrets
import time
from dataclasses import replace
from typing import Final, NamedTuple

from app.cell.alarms.states import AlarmInstance
from app.cell.commands.acts import ActReceipt, ActRequest
from app.cell.commands.alarm_acts import press_id_of, press_of, sentence_of
from app.cell.commands.receipts import Receipt
from app.cell.permission.roles import ConfirmedBy
from app.cell.session.session import RobotSession
from app.records.principal import Principal
from app.system.texts import Text, TextLike, say
from app.web.alarm_answers import AlarmActBody
from app.web.app_state import AppState

DISK_TIMEOUT_S: Final = 2.0  # then the receipt says that the act is not safely on the disk
ANSWERED_WITHIN_S: Final = 2.5  # then the receipt says that the robot has not answered the command yet


class AlarmRun(NamedTuple):
    """The receipt of an act, and that of the command of an acknowledgement: None if none was sent, or
    if it is not answered."""

    receipt: ActReceipt
    command: Receipt | None = None


class AlarmRuns:
    """The acts of one request of a client. Acknowledging several alarms presses a control that takes no
    input once."""

    def __init__(
        self,
        state: AppState,
        who: Principal,
        refusal: Text | None,
        *,
        scripted: bool,
        confirmed: ConfirmedBy | None = None,
    ) -> None:
        """`refusal`: why all are refused. `confirmed`: who confirmed the act with a PIN."""
        self._state = state
        self._who = who
        self._refusal = refusal
        self._scripted = scripted
        self._confirmed = confirmed
        self._pressed: set[str] = set()

    async def run(self, act: str, alarm_id: str, body: AlarmActBody) -> AlarmRun:
        """Runs an act on an alarm."""
        alarm = self._state.fleet.alarms.engine.alarms.get(alarm_id)
        session = self._session(alarm)
        runner = session.alarm_acts
        # One rendered page has one id for all its buttons, and each is an act of its own.
        act_id = f"{body.id}.{act}.{alarm_id}" if body.id else secrets.token_hex(8)
        at = body.at.timestamp() if body.at else None
        values = body.values(alarm_id, time.time())
        if body.id and body.for_s is not None and (earlier := runner.request(act_id)):
            values = dict(earlier.values)  # its end was that of the first request
        request = ActRequest(act, self._who, alarm_id, values, at, self._scripted)
        request = request._replace(confirmed=self._confirmed)
        if self._refusal is not None:
            return AlarmRun(runner.limited(request, act_id, self._refusal))
        acknowledges = alarm is not None and act == "acknowledge" and not alarm.status.is_acknowledged
        is_repeated = session.presses.receipt(press_id_of(act_id)) is not None
        receipt = await runner.act(request, act_id)
        if not receipt.done:
            return AlarmRun(receipt)
        if not await self._state.fleet.alarms.written(DISK_TIMEOUT_S):
            receipt = replace(receipt, reason=receipt.reason or say("alarm_act_not_on_disk"))
        if alarm is None or not (acknowledges or is_repeated):
            return AlarmRun(receipt)
        said, command = await self._send(session, alarm, act_id, request)
        return AlarmRun(replace(receipt, reason=said or receipt.reason), command)

    async def _send(
        self, session: RobotSession, alarm: AlarmInstance, act_id: str, request: ActRequest
    ) -> tuple[TextLike, Receipt | None]:
        """Sends the command of an acknowledged alarm; returns what became of it. ("", None) if it has
        none."""
        described = alarm.definition.alarm
        control = described.ack_command
        if control is None or (described.ack_input is None and control in self._pressed):
            return "", None
        self._pressed.add(control)
        session = self._state.fleet.session_for(session, control)
        widget = session.presses.widget(control)
        press = press_of(alarm, widget, act_id, request.who, request.at)
        task = asyncio.ensure_future(self._state.counted(session.presses.press(press)))
        await asyncio.wait((task,), timeout=ANSWERED_WITHIN_S)
        receipt = task.result() if task.done() else None
        return sentence_of(widget.label, receipt), receipt

    def _session(self, alarm: AlarmInstance | None) -> RobotSession:
        """The session of an alarm's robot: who has control there may act. The panel's own alarms are of
        the first robot."""
        sessions = self._state.fleet.sessions
        robot = alarm.definition.robot if alarm else ""
        known = {session.entry.id if session.entry else "": session for session in sessions}
        return known.get(robot, self._state.fleet.first)

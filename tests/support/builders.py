"""Builders for unit tests: a panel, a robot that is connected, its messages."""

import asyncio
from collections.abc import Callable, Collection, Iterable, Mapping
from typing import Any, Final, TypeVar

from app.cell.commands.confirmations import Confirmations
from app.cell.commands.dispatch import Dispatcher, Trackers
from app.cell.commands.goals import GoalTracker
from app.cell.commands.judge import PendingSamples, PressGuard, PressJudge
from app.cell.commands.parameters import ParameterSync
from app.cell.commands.press import Press
from app.cell.commands.presses import Presses
from app.cell.commands.receipts import Receipt
from app.cell.commands.recipe_loads import RecipeLoader
from app.cell.commands.services import ServiceCalls
from app.cell.commands.transport import Transport
from app.cell.permission.control import ControlAuthority
from app.cell.robot.state import RobotState, Sample
from app.cell.session.recipes import Recipes
from app.cell.view.publisher import ViewPublisher
from app.cell.view.view import build_view
from app.panel.model import Panel
from app.panel.widgets.families import Command
from app.records import NullLog
from app.records.press_record import PressLog
from app.records.principal import Principal, anonymous
from app.ros.dialects import bridge_dialect
from app.ros.dialects.bridge_dialect import BridgeDialect
from app.ros.dialects.dialect import TopicRole
from app.ros.dialects.peer_traits import BRIDGE_TRAITS
from app.ros.messages import Interfaces, load_interfaces
from app.ros.messages.names import Qos
from app.system.errors import PanelError

Table = Mapping[str, Any]
Widget = TypeVar("Widget", bound=Command)

INTERFACES: Final = load_interfaces("jazzy")
DIALECT: Final = BridgeDialect()
TRAITS: Final = BRIDGE_TRAITS
BOOL: Final = "std_msgs/msg/Bool"
TEXT: Final = "std_msgs/msg/String"
BRIDGE: Final = "b1"
KIOSK: Final = "c1"
ENABLED: Final = "/operation_enabled"
NOW: Final = 1000.0  # monotonic seconds
PROGRAM: Final = Principal(anonymous("127.0.0.1"))
NOTHING: Final[Table] = {}
VIEW: Final = "5eed"  # the instance id of the guard's view

INTERLOCK: Final[Table] = {"id": "operation", "topic": ENABLED}
MESSAGE: Final[Table] = {"id": "message", "kind": "text", "label": "Message", "max_length": 8}
FREE: Final[Table] = {
    "id": "free",
    "kind": "publish",
    "label": "Free",
    "topic": "/free",
    "type": TEXT,
    "message": {"data": "{message}"},
}
GUARDED: Final[Table] = {**FREE, "id": "guarded", "topic": "/guarded", "interlock": "operation"}
HEARD: Final[Table] = {
    "id": "heard",
    "kind": "readout",
    "label": "Heard",
    "topic": "/heard",
    "type": TEXT,
}
COUNT: Final[Table] = {
    "id": "count",
    "kind": "action",
    "label": "Count",
    "action": "/count",
    "type": "example_interfaces/action/Fibonacci",
    "goal": {"order": 3},
}


def faults_text(error: PanelError) -> str:
    """The faults of a panel file, one per line, without their positions."""
    return "\n".join(f"{fault.place}: {fault.message}" for fault in error.faults)


def panel_of(
    *widgets: Table, interlock: Table = NOTHING, further: Iterable[Table] = (), **more: Any
) -> Panel:
    """A panel with one page. `interlock` overrides keys of its interlock; `further` are more
    interlocks."""
    page = {"id": "one", "title": "One", "widget": list(widgets)}
    tables = {"title": "Cell", "interlock": [{**INTERLOCK, **interlock}, *further], "page": [page]}
    return Panel.model_validate({**tables, **more})


def small_panel(interlock: Table = NOTHING, **more: Any) -> Panel:
    """One widget of each kind, and a button behind the interlock."""
    return panel_of(MESSAGE, FREE, GUARDED, HEARD, interlock=interlock, **more)


def robot_there(panel: Panel, *, interfaces: Interfaces = INTERFACES, **callbacks: Any) -> RobotState:
    """A robot that commands can reach: link and bridge are up. It has not published yet."""
    robot = RobotState(panel, interfaces, DIALECT, TRAITS, KIOSK, **callbacks)
    robot.link_up = True
    robot.settled_at = 0.0
    robot.graph.apply_token(bridge_dialect.bridge_token(BRIDGE), True)
    return robot


def endpoint(
    robot: RobotState,
    role: TopicRole,
    topic: str,
    type_name: str,
    zid: str = BRIDGE,
    alive: bool = True,
    qos: Qos | None = None,
) -> str:
    """Adds or removes (`alive=False`) a publisher ("MP") or subscriber ("MS") behind a bridge; returns
    its token."""
    type_hash = INTERFACES.type_hash(type_name)
    token = bridge_dialect.token(zid, role, robot.key(topic), type_name, qos or Qos(), type_hash)
    robot.graph.apply_token(token, alive)
    return token


def says(
    robot: RobotState,
    topic: str,
    data: Any,
    type_name: str = TEXT,
    *,
    at: float = NOW,
    seq: int = 1,
    source: str | None = BRIDGE,
) -> None:
    """The robot publishes a message whose only field is `data`."""
    payload = INTERFACES.encode(type_name, {"data": data})
    robot.update(robot.key(topic), Sample(payload, seq, at, at, source))


def permits(robot: RobotState, permitted: bool = True, *, at: float = NOW) -> None:
    """The robot publishes whether operation is permitted."""
    says(robot, ENABLED, permitted, BOOL, at=at)


class FakeTransport:
    """A link with matching subscribers, on which neither a message nor a query is expected."""

    def put(self, key: str, payload: bytes) -> None:
        raise AssertionError(f"unexpected message: {key}")

    def has_reader(self, key: str) -> bool:
        return True

    def query(self, key: str, payload: bytes, timeout_s: float) -> "asyncio.Future[bytes | None]":
        raise AssertionError(f"unexpected query: {key}")


def sending_of(
    panel: Panel,
    robot: RobotState,
    transport: Transport,
    *,
    calls: ServiceCalls | None = None,
    confirmations: Confirmations | None = None,
    monotonic: Callable[[], float] = lambda: NOW,
    **more: Any,
) -> Dispatcher:
    """A dispatcher, with defaults for the parts that a test does not provide."""
    calls = calls or ServiceCalls(INTERFACES, robot, transport, lambda _: None)
    parameters = ParameterSync(panel, INTERFACES, robot, transport, calls, lambda: None)
    return Dispatcher(
        panel,
        INTERFACES,
        robot,
        transport,
        Trackers(
            calls,
            GoalTracker(INTERFACES, robot, transport, lambda _: None),
            confirmations or Confirmations(robot, lambda _: None),
            parameters,
            RecipeLoader(INTERFACES, robot, parameters, Recipes(panel), lambda _: None),
        ),
        monotonic,
        **more,
    )


def guard_of(
    panel: Panel,
    robot: RobotState,
    control: ControlAuthority | None = None,
    other_views: Collection[str] = (),
) -> PressGuard:
    """The conditions for presses; `other_views` are the instance ids of other robots' views."""
    control = control or ControlAuthority(panel.control, robot.title, log_line=lambda *_: None)
    publisher = ViewPublisher(build_view(panel, robot, NOW).view, "r1")
    publisher.instance_id = VIEW
    return PressGuard(publisher, control, NullLog(), panel.press_expires_s, lambda: other_views)


def press_of(
    widget: Widget,
    inputs: Mapping[str, Any],
    press_id: str = "p1",
    principal: Principal = PROGRAM,
    seen: str = "",
) -> Press[Widget]:
    """A press by a program on the kiosk."""
    return Press(press_id, widget, inputs, principal, seen)


async def press_widget(
    presses: Presses, widget: str, inputs: Mapping[str, Any], *about: Any, **more: Any
) -> Receipt:
    """The receipt of a press; the further arguments are those of `press_of`."""
    return await presses.press(press_of(presses.widget(widget), inputs, *about, **more))


def presses_of(
    panel: Panel,
    robot: RobotState,
    transport: Transport,
    *,
    press_log: PressLog | None = None,
    guard: PressGuard | None = None,
    monotonic: Callable[[], float] = lambda: NOW,
    catch_up: Callable[[], None] = lambda: None,
    news: Callable[[], bool] = lambda: False,
    **more: Any,
) -> Presses:
    """The presses of a robot; `more` is for `sending_of`."""
    sending = sending_of(panel, robot, transport, monotonic=monotonic, **more)
    guard = guard or guard_of(panel, robot)
    judge = PressJudge(panel, robot, guard, PendingSamples(catch_up, news), monotonic)
    return Presses(judge, sending, press_log or PressLog(NullLog()), robot.name)

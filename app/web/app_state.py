"""The application's state, typed, as the routes get it."""

from collections.abc import Awaitable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Annotated, Final

from fastapi import Depends, Path
from starlette.requests import HTTPConnection

from app.cell.commands.acts import ActContext, ActRunner
from app.cell.commands.judge import PressLimits
from app.cell.commands.receipts import Receipt
from app.cell.commands.user_acts import USER_ACTS, end_lock
from app.cell.people.access import Access
from app.cell.people.confirmer import Confirmer
from app.cell.session.doctor_process import DoctorProcess
from app.cell.session.fleet import Fleet
from app.cell.session.session import RobotSession
from app.records import NullLog, OperatorLog
from app.records.press_record import PressLog
from app.records.principal import Clients
from app.system.concurrency import BuiltOnce, InFlight
from app.system.limits import BoundedDict
from app.system.texts import TextLike
from app.web.assets import Assets
from app.web.downloads import SharedRecordings
from app.web.metrics import Metrics, PageTrips
from app.web.pages.page_templates import PageTemplates

if TYPE_CHECKING:
    from app.cell.commands.machine_acts import MachineRunner
    from app.cell.session.sent_panels import PanelReceiver
    from app.cell.site.wall import Wall

FORMS_KEPT: Final = 64


@dataclass(frozen=True, slots=True)
class RefusedForm:
    """What was typed in a form that was refused: its page, with its query, shows it again. `reason` is
    why, where no receipt says it."""

    page: str
    typed: Mapping[str, str]
    reason: TextLike = ""


EMPTY_FORM: Final = RefusedForm("", {})


@dataclass(slots=True)
class AppState:
    """The state that requests need. `description` is that of all paths, as JSON and packed, if it was
    requested. `receiver` takes panel files that engineers send, None where the settings do not permit
    it. `wall` has the cells of a wall, whose fleet has no robot; None for a panel."""

    fleet: Fleet
    assets: Assets
    templates: PageTemplates
    metrics: Metrics
    log: OperatorLog | NullLog
    limits: PressLimits
    doctor: DoctorProcess
    access: Access
    wall: "Wall | None" = None
    clients: Clients = field(default_factory=Clients)
    page_trips: PageTrips = field(default_factory=PageTrips)
    in_flight: InFlight = field(default_factory=InFlight)
    shared: SharedRecordings = field(default_factory=SharedRecordings)
    description: BuiltOnce[tuple[bytes, bytes]] | None = None
    receiver: "PanelReceiver | None" = None
    # The newest of each client, by the ids of the client and of the user.
    refused_forms: BoundedDict[tuple[str, str], RefusedForm] = field(
        default_factory=lambda: BoundedDict[tuple[str, str], RefusedForm](FORMS_KEPT)
    )
    user_acts: ActRunner[Access] = field(init=False)
    machine_acts: "MachineRunner | None" = None  # made at its first use
    confirmer: Confirmer = field(init=False)

    def __post_init__(self) -> None:
        guard, nothing_shown = self.fleet.first.press_guard, lambda: None
        context = ActContext(guard, PressLog(self.log), "", nothing_shown)
        self.user_acts = ActRunner(
            "access", USER_ACTS, self.access, context, further_lock=partial(end_lock, self.access)
        )
        self.confirmer = Confirmer(self.access)

    @property
    def root(self) -> str:
        """The path below which a proxy shows all pages; "" without one."""
        return self.fleet.root_path

    @property
    def banner(self) -> TextLike:
        """The banner of a page that belongs to no robot: that one of the robots is simulated; "" for
        none."""
        banners = (session.publisher.view["notice"]["banner"] for session in self.fleet.sessions)
        return next((banner for banner in banners if banner), "")

    async def counted(self, command: Awaitable[Receipt]) -> Receipt:
        """The receipt of a command, counted in the metrics; shutdown waits for it."""
        with self.in_flight.track():
            receipt = await command
        self.metrics.pressed(receipt.outcome)
        return receipt


def site_of(request: HTTPConnection) -> AppState:
    state: AppState = request.app.state.app_state
    return state


async def _current(request: HTTPConnection) -> AppState:
    return site_of(request)  # not itself the dependency: plain functions run on a thread


CurrentState = Annotated[AppState, Depends(_current)]


async def _of_path(request: HTTPConnection) -> RobotSession:
    return site_of(request).fleet.session(request.path_params.get("robot"))


async def _of_widget(request: HTTPConnection) -> RobotSession:
    session = await _of_path(request)
    return site_of(request).fleet.session_for(session, request.path_params.get("widget", ""))


# The session of the robot in the path, whose pages are shown; and that of the widget in the path, which
# may be another robot's.
PageSession = Annotated[RobotSession, Depends(_of_path)]
CurrentSession = Annotated[RobotSession, Depends(_of_widget)]


async def named_robot(robot: Annotated[str, Path(description="The id of a [[robot]]")]) -> None:
    """Describes the path parameter of a robot, for the paths of a panel with several."""

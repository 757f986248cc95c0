"""What each route needs: the one table of routes and roles, and its guard.

Presses, holds and acts are judged where they are made, with a receipt and an entry in the operator's
log: their routes need nothing here. A widget that a client does not see has no route for it.
"""

from collections.abc import Mapping
from typing import Final

from starlette.requests import HTTPConnection

from app.cell.permission.roles import role_name, unmet
from app.panel.layout import Page
from app.panel.roles import ANYBODY, ENGINEER, MAINTENANCE, OPERATOR
from app.records.principal import Principal
from app.system.errors import RoleNeeded
from app.system.texts import say
from app.web.app_state import AppState, site_of
from app.web.caller import caller_of

LOCAL_ONLY: Final = "local"  # an operator, or anybody on the server's own machine
ROBOT: Final = "/robots/{robot}"  # stands before the paths of one of several robots

ROUTE_NEEDS: Final[Mapping[str, str]] = {
    # What everyone sees.
    "/": ANYBODY,
    "/pages/{page}": ANYBODY,
    "/events": ANYBODY,
    "/widgets/{widget}/frame": ANYBODY,
    "/widgets/{widget}/frames": ANYBODY,
    "/widgets/{widget}/lines": ANYBODY,
    "/widgets/{widget}/lock": ANYBODY,
    "/widgets/{widget}/map.png": ANYBODY,
    "/widgets/{widget}/map/routes/{version}.json": ANYBODY,
    "/widgets/{widget}/map/{version}/{column}-{row}.png": ANYBODY,
    "/widgets/{widget}/place": ANYBODY,
    "/widgets/{widget}/trend": ANYBODY,
    "/alarms": ANYBODY,
    "/help": ANYBODY,
    "/recordings/shared/{token}.mcap": ANYBODY,  # the token permits it, see POST /diagnostics/foxglove
    "/display": ANYBODY,
    "/static/{revision}/{name:path}": ANYBODY,
    "/healthz": ANYBODY,
    "/readyz": ANYBODY,
    # Who signs in and out.
    "/session": ANYBODY,
    "/sessions": ANYBODY,  # one's own
    "/sessions/end": ANYBODY,  # judged where it is made
    "/session/end": ANYBODY,
    "/session/here": ANYBODY,
    "/session/oidc": ANYBODY,
    "/session/oidc/back": ANYBODY,
    "/signin": ANYBODY,
    # Judged where they are made. A cancel stops, and needs nothing.
    "/widgets/{widget}": ANYBODY,
    "/widgets/{widget}/cancel": ANYBODY,
    "/widgets/{widget}/confirm": ANYBODY,
    "/widgets/{widget}/hold": ANYBODY,
    "/presses": ANYBODY,
    "/alarms/acknowledge": ANYBODY,
    "/alarms/{alarm:path}/{act}": ANYBODY,
    "/alarms/{alarm:path}/{act}/confirm": ANYBODY,
    "/control/here": ANYBODY,
    "/control/{act}": ANYBODY,
    "/diagnostics/{act}": ANYBODY,
    "/stops/{key}/reason": ANYBODY,
    "/stops/{key}/foxglove": ANYBODY,
    "/recipes/{set}/{act}": ANYBODY,
    "/recipes/{set}/import": ANYBODY,
    "/places/{widget}/{act}": ANYBODY,
    "/panel/take": ANYBODY,
    # What has been, and what the robot is asked.
    "/widgets/{widget}/read": OPERATOR,
    "/alarms/history": OPERATOR,
    "/alarms/history.csv": OPERATOR,
    "/alarms/figures": OPERATOR,
    "/alarms/report": OPERATOR,
    "/stops": OPERATOR,
    "/stops/latest": OPERATOR,
    "/stops/alarm": OPERATOR,
    "/stops/{key}": OPERATOR,
    "/stops/asked": OPERATOR,
    "/stops/{key}/story.json": OPERATOR,
    "/stops/{key}/parcel.zip": MAINTENANCE,
    "/oee": OPERATOR,
    "/oee/figures": OPERATOR,
    "/oee/stops.csv": OPERATOR,
    "/log": OPERATOR,
    "/log.csv": OPERATOR,
    "/recipes": OPERATOR,
    "/recipes/{set}": OPERATOR,
    "/recipes/{set}.csv": OPERATOR,
    "/places/{widget}": OPERATOR,
    "/openapi.json": OPERATOR,
    "/metrics": LOCAL_ONLY,
    # For the engineer.
    "/diagnostics": MAINTENANCE,
    "/diagnostics/look": MAINTENANCE,
    "/recordings/last.mcap": MAINTENANCE,
    "/recordings/{name}.mcap": MAINTENANCE,
    "/panel": ENGINEER,
    "/panel/check": ENGINEER,
    "/panel/file": ENGINEER,
    "/users": ENGINEER,
    "/users/{act}": ENGINEER,
    # In development only.
    "/gallery": ENGINEER,
    "/gallery/box.svg": ENGINEER,
}


# The routes that only a wall has.
OF_WALL: Final[Mapping[str, str]] = {"/wall/events": ANYBODY}


async def route_guard(connection: HTTPConnection) -> None:
    """RoleNeeded for a client without what the route needs, or that does not see the widget of the
    path. A route that is not in the table needs an engineer."""
    if site_of(connection).access.has_roles:
        check_route(connection, getattr(connection.scope.get("route"), "path", ""))


def check_route(connection: HTTPConnection, route: str) -> None:
    """RoleNeeded as by `route_guard`, for the template of a path."""
    state = site_of(connection)
    path = route.removeprefix(ROBOT) or "/"
    need = ROUTE_NEEDS.get(path, OF_WALL.get(path, ENGINEER))
    widget = connection.path_params.get("widget", "")
    if not need and not widget:
        return
    who = caller_of(connection).principal
    if need == LOCAL_ONLY:
        need = ANYBODY if who.client.local else OPERATOR
    if not who.meets(need):
        raise needed(need)
    if widget in hidden_widgets(state, who):
        pages = state.fleet.panel.needs.shown_on[widget]
        raise needed(min(state.fleet.panel.needs.pages[page] for page in pages))


def hidden_widgets(state: AppState, who: Principal) -> frozenset[str]:
    """The widgets that a client does not see."""
    needs = state.fleet.panel.needs
    return needs.hidden_widgets(unmet(needs.named, who)) if needs.pages else frozenset()


def needed(need: str) -> RoleNeeded:
    """The error for a client without this role or group."""
    return RoleNeeded(say("page_needs_role", role=role_name(need)), need)


def check_page(page: Page, who: Principal) -> None:
    """RoleNeeded for a client that may not see the page."""
    if page.needs and not who.meets(page.needs):
        raise needed(page.needs)

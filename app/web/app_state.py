"""What the routes share: the application's state, typed."""

from collections.abc import Awaitable
from dataclasses import dataclass, field
from typing import Annotated

from fastapi import Depends, Path
from jinja2 import Environment
from starlette.requests import HTTPConnection

from app.audit import OperatorLog, Unlogged
from app.commands.press_limits import PressLimits
from app.commands.receipts import Receipt
from app.concurrency import Owed
from app.permission.clients import Browsers
from app.runtime.fleet import Fleet
from app.runtime.robot_session import Kiosk
from app.web.assets import Assets
from app.web.metrics import Metrics


@dataclass(slots=True)
class Site:
    """All that a request needs."""

    fleet: Fleet
    assets: Assets
    templates: Environment
    metrics: Metrics
    log: OperatorLog | Unlogged
    limits: PressLimits
    browsers: Browsers = field(default_factory=Browsers)
    owed: Owed = field(default_factory=Owed)

    @property
    def banner(self) -> str:
        """What stands above a page of no robot: that one is simulated."""
        banners = (kiosk.board.view["notice"]["banner"] for kiosk in self.fleet.kiosks)
        return next(filter(None, banners), "")

    async def counted(self, command: Awaitable[Receipt]) -> Receipt:
        """The receipt of a command, counted in the metrics; shutdown waits for it."""
        with self.owed.one():
            receipt = await command
        self.metrics.pressed(receipt.outcome)
        return receipt


def site_of(request: HTTPConnection) -> Site:
    site: Site = request.app.state.site
    return site


async def _current(request: HTTPConnection) -> Site:
    return site_of(request)  # not itself the dependency: plain functions run on a thread


CurrentSite = Annotated[Site, Depends(_current)]


async def _of_robot(request: HTTPConnection) -> Kiosk:
    return site_of(request).fleet.kiosk(request.path_params.get("robot"))


CurrentKiosk = Annotated[Kiosk, Depends(_of_robot)]


async def named_robot(robot: Annotated[str, Path(description="The id of a [[robot]]")]) -> None:
    """What every path of one of several robots has in it."""

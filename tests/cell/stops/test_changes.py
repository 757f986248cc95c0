"""What the observer of changes reports as a stop."""

import asyncio

from app.cell.stops.changes import ChangeJournal, ChangeObserver
from tests.support.builders import panel_of, robot_there


def test_a_lost_link_is_a_stop_once() -> None:
    async def work() -> None:
        panel, stops = panel_of(), list[int]()
        robot = robot_there(panel)
        observer = ChangeObserver(panel, robot, ChangeJournal(), lambda: stops.append(1))
        for link_up, count in ((True, 0), (False, 1), (False, 1), (True, 1), (False, 2)):
            robot.link_up = link_up
            observer.step((), True)
            observer.finish()
            assert len(stops) == count

    asyncio.run(work())

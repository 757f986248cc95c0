"""The figures of a shift of a running server."""

from app.cell.session.fleet import Fleet
from app.cell.session.stops import StopReader
from app.cell.stops.oee import Plan, ShiftFigures, Span, quantities, shift_figures
from app.records import NullLog, OperatorLog


async def figures_of(
    fleet: Fleet, log: OperatorLog | NullLog, robot: str, since: float, until: float
) -> ShiftFigures:
    """The figures of a robot ("" for the first) from `since` on and before `until`, in seconds since
    the epoch. LogError if the stores can't be read, TooMany if too many searches run."""
    reader, span = StopReader(fleet, log), Span(since, until)
    entry = fleet.of_robot(robot).entry
    name = entry.id if entry else ""
    recorded, stops = await reader.standstills(name, since, until)
    rows = await reader.counts(name, since, until)
    rules, states = fleet.panel.oee, fleet.panel.state
    if rules is None or states is None:
        return shift_figures(span, [], [], quantities([], (), span), Plan(()))
    plan = Plan(
        rules.running_values(states),
        rules.breaks,
        rules.reason_after_s,
        rules.ideal_cycle_s,
        frozenset(reason.id for reason in rules.reasons if reason.planned),
    )
    quantity = quantities(rows, [counter.parts for counter in rules.counters], span)
    return shift_figures(span, recorded, stops, quantity, plan)

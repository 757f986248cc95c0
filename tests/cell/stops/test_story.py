"""The first cause of stops with a known one: told, or said that it can't be told, never another one."""

from typing import Any

import pytest

from app.cell.stops.story import BEFORE_S, MOST_EVENTS, Event, Stop, story_of

pytestmark = pytest.mark.promise("stops")

GUARD, AIR, BOX, MODE = ("/guard", "data"), ("/air", "data"), ("/box", "data"), ("/state", "data")
AT = 1_000.0  # of each stop


def event(at: float, sort: Any = "interlock", name: str = "guard", **more: Any) -> Event:
    """An event `at` seconds after the stop that breaks something, unless it is said otherwise."""
    values: dict[str, Any] = {"breaks": True, "sources": frozenset({(f"/{name}", "data")})} | more
    if values.get("sent") is not None:
        values["sent"] += AT
    return Event(AT + at, sort, name, name, **values)


def well(at: float, sort: Any = "interlock", name: str = "guard", **more: Any) -> Event:
    return event(at, sort, name, breaks=False, heals=True, **more)


def stop(sort: Any = "state", **more: Any) -> Stop:
    return Stop(AT, "", sort, 1, "FAULT", "FAULT", **({"sources": frozenset({MODE})} | more))


STATE = event(0.0, "state", "FAULT", breaks=False, sources=frozenset({MODE}))
PRESS = event(-31.4, "press", "start", breaks=False, sources=frozenset())

# What changed → the name of the first cause, or why it can't be told.
STOPS: dict[str, tuple[list[Event], str]] = {
    "guard opened": ([event(-1.2)], "guard"),
    "guard, then the alarm about it": (
        [event(-1.2), event(-1.19, "alarm", "door", sources=frozenset({GUARD}))],
        "door",
    ),
    "alarm after a delay": (
        [
            event(-0.5, "alarm", "door", began_s=1.0, sources=frozenset({GUARD})),
            event(-0.7, name="air"),
        ],
        "door",
    ),
    "drives follow from the guard": ([event(-1.2), event(-1.0, name="drives")], "guard"),
    "an alarm that follows in its group is not the first": (
        [event(-3.0, "alarm", "late", follows="door"), event(-1.2)],
        "guard",
    ),
    "air low, long before, then the guard": ([event(-50.0, name="air"), event(-1.0)], "guard"),
    "air low and all at rest for long": ([event(-50.0, name="air")], "none_named"),
    "nothing changed": ([PRESS], "none_named"),
    "a guard that was closed again": ([event(-9.0), well(-8.0)], "none_named"),
    "a guard that was opened and closed right before": ([event(-1.0), well(-0.7)], "guard"),
    "a box that comes in each cycle": (
        [
            e
            for at in (-40, -30, -20, -3)
            for e in (event(at, "condition", "box"), well(at + 1.5, "condition", "box"))
        ],
        "none_named",
    ),
    "a contact that bounces": (
        [e for at in (-1.0, -0.9, -0.8, -0.7) for e in (event(at), well(at + 0.05))],
        "guard",
    ),
    "two at the same moment": ([event(-1.0), event(-0.98, name="air")], "same_moment"),
    "two at one moment, ordered by stamps": (
        [event(-1.0, sent=-1.05), event(-0.98, name="air", sent=-1.06)],
        "air",
    ),
    "stamps that are equal": (
        [event(-1.0, sent=-1.05), event(-0.98, name="air", sent=-1.0503)],
        "same_moment",
    ),
    "what follows from a stop, as the panel says": ([event(-0.1, name="no_fault")], "none_named"),
    "an alarm about the state itself": (
        [event(0.0, "alarm", "fault", sources=frozenset({MODE}))],
        "none_named",
    ),
    "a node ended, so a value is not known": (
        [
            event(-0.8, "node", "driver", sources=frozenset({("node", "driver"), GUARD})),
            event(-0.8, "publisher", "/guard", sources=frozenset({GUARD})),
            event(-0.8),
        ],
        "driver",
    ),
    "the link, with all that it carries": (
        [
            event(-0.2, "link", "", sources=frozenset({GUARD, AIR, ("link", "")})),
            event(0.3, name="air"),
        ],
        "",
    ),
    "stamps of two clocks": (
        [
            event(-1.0, sent=-1.05, clock="a"),
            event(-0.9, name="air", sent=-0.9, clock="b"),
        ],
        "same_moment",
    ),
    "a stamp is compared with an arrival by arrivals": (
        [event(-0.6, sent=-1.2), event(-0.59, "alarm", "drive", sources=frozenset({AIR}))],
        "same_moment",
    ),
    "an alarm that is raised some time after an interlock changed": (
        [event(-1.0), event(-0.8, "alarm", "drive", sources=frozenset({AIR}))],
        "same_moment",
    ),
    "an alarm has the stamp of its value": (
        [
            event(-1.0, sent=-1.05),
            event(-0.9, "alarm", "door", sources=frozenset({GUARD})),
            event(-0.98, name="air", sent=-1.03),
        ],
        "door",
    ),
    "a contact that was open longer than in each cycle, then the drives": (
        [
            *(e for at in (-40, -30, -20) for e in (event(at), well(at + 0.5))),
            event(-5.0),
            event(-3.0, name="drives"),
        ],
        "cycle",
    ),
    "a contact that is open as in each cycle, and the drives": (
        [
            *(e for at in (-40, -30, -20) for e in (event(at), well(at + 3.0))),
            event(-5.0),
            event(-3.0, name="drives"),
        ],
        "drives",
    ),
    "a box that was missing a little longer in the last cycle": (
        [
            *(
                e
                for at in (-40, -30, -20)
                for e in (event(at, "condition", "box"), well(at + 1.1, "condition", "box"))
            ),
            event(-2.5, "condition", "box"),
            well(-1.3, "condition", "box"),
            event(-0.5),
        ],
        "guard",
    ),
    "the link was cut right before": (
        [
            event(-7.0, "link", "", sources=frozenset({("link", "")})),
            well(-5.0, "link", "", sources=frozenset({("link", "")})),
            event(-0.5),
        ],
        "cut",
    ),
    "Stop was pressed, the machine started again, then the guard opened": (
        [
            event(-6.0, "press", "stop", sources=frozenset()),
            well(-3.0, "state", "RUNNING", sources=frozenset({MODE})),
            event(-0.5),
        ],
        "guard",
    ),
    "an operator pressed Stop": ([event(-0.4, "press", "stop", sources=frozenset())], "stop"),
    "the panel server was started right before": (
        [event(-4.0, "server", "began", breaks=False), event(-1.0)],
        "restarted",
    ),
    "what comes after the stop is no cause": ([event(0.2)], "none_named"),
    "the guard arrived right after the state": ([event(0.03)], "guard"),
}


@pytest.mark.parametrize("name", STOPS)
def test_first_cause(name: str) -> None:
    events, expected = STOPS[name]
    story = story_of(stop(sent=AT), [PRESS, STATE, *events], effects={"no_fault"})
    told = story.first.id if story.first is not None else story.why
    assert told == expected
    assert (story.first is None) == (story.why is not None)
    assert [line.event for line in story.lines if line.is_first] == (
        [story.first] if story.first else []
    )


@pytest.mark.parametrize(
    ("of_stop", "events", "expected"),
    [
        (stop("alarm", sources=frozenset()), [event(0.0, "alarm", "FAULT")], "FAULT"),
        (
            stop("alarm", sources=frozenset()),
            [event(-0.5, name="air"), event(0.0, "alarm", "FAULT")],
            "air",
        ),
        (stop("link", sources=frozenset()), [event(0.0, "link", "")], ""),
        (stop("goal", sources=frozenset()), [event(0.0, "goal", "FAULT", breaks=False)], "none_named"),
        (
            stop("goal", sources=frozenset()),
            [event(-2.0), event(0.0, "goal", "FAULT", breaks=False)],
            "guard",
        ),
    ],
    ids=["alarm alone", "alarm after a condition", "link", "goal alone", "goal after the guard"],
)
def test_stops_that_are_no_states(of_stop: Stop, events: list[Event], expected: str) -> None:
    story = story_of(of_stop, events)
    assert (story.first.id if story.first else story.why) == expected


def test_times_have_no_more_digits_than_the_clocks_agree_on() -> None:
    stamped = story_of(stop(sent=AT), [event(-1.0, sent=-1.2), event(-0.9, name="drives", sent=-1.188)])
    assert stamped.by_stamps
    assert stamped.following is not None
    assert str(stamped.span_text(stamped.following.begun - stamped.zero)) == "12 ms"
    arrived = story_of(stop(), [event(-1.2), event(-0.9, name="drives")])
    assert not arrived.by_stamps
    assert str(arrived.span_text(0.3)) == "0.3 s"


def test_what_follows_from_each_stop_is_not_named_in_the_sentence() -> None:
    events = [event(-1.0, sent=-1.2), event(-0.9, name="no_fault", sent=-1.199)]
    assert story_of(stop(sent=AT), events, {"no_fault"}).following is None
    events.append(event(-0.8, name="drives", sent=-1.18))
    following = story_of(stop(sent=AT), events, {"no_fault"}).following
    assert following is not None
    assert following.id == "drives"


def test_a_flood_is_cut_and_counted() -> None:
    flood = [
        event(-BEFORE_S + 1 + n * 1e-3, "press", f"p{n}", breaks=False) for n in range(MOST_EVENTS + 7)
    ]
    story = story_of(stop(), [*flood, event(-0.5)])
    assert len(story.lines) == MOST_EVENTS
    assert not story.is_complete
    assert story.first is not None
    assert story.first.id == "guard"


def test_what_was_first_is_not_told_where_a_store_had_more_than_was_read() -> None:
    story = story_of(stop(), [event(-0.5)], are_complete=False)
    assert (story.first, story.why, story.is_complete) == (None, "too_many", False)


def test_the_short_story_keeps_the_first_cause_and_the_order() -> None:
    many = [event(-50.0 + n, "press", f"p{n}", breaks=False) for n in range(40)]
    story = story_of(stop(), [*many, event(-9.0), STATE])
    short = story.short(10)
    assert len(short) == 10
    assert [line.event.id for line in short if line.is_first] == ["guard"]
    assert [line.offset_s for line in short] == sorted(line.offset_s for line in short)

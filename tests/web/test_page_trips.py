"""Round trips of browsers, in memory that no number of browsers fills."""

from app.web.metrics import MOST_BROWSERS, PageTrips

BEGAN = 1000.0


def test_each_browser_has_its_own_and_the_last_ones_are_kept() -> None:
    trips = PageTrips()
    for number in range(MOST_BROWSERS + 1):
        trips.record(f"browser {number}", 0.001 * (number + 1), BEGAN + number)
    assert trips.summary("browser 0", BEGAN + MOST_BROWSERS) is None
    summary = trips.summary("browser 1", BEGAN + MOST_BROWSERS)
    assert summary is not None
    assert summary.median == 0.002


def test_one_that_goes_on_stays() -> None:
    trips = PageTrips()
    for number in range(2 * MOST_BROWSERS):
        trips.record(f"browser {number}", 0.001, BEGAN)
        trips.record("engineer", 0.005, BEGAN)
    summary = trips.summary("engineer", BEGAN)
    assert summary is not None
    assert summary.last == 0.005

"""What the benchmark makes of numbers; nothing is measured here."""

import math
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any

import pytest

from app.panel import load_panel
from bench.kiosk import Robot, panel
from bench.report.figures import (
    percentile,
    presses_matched,
    ratio,
    shown_after,
    slope,
    toggles_matched,
)
from bench.report.picture import picture
from bench.report.store import Store, figure
from bench.report.tables import BEGIN, END, whole, write
from bench.report.targets import Target, best_rival, grown, targets

MS = 1e6  # in ns
TITLES = {"kiosk": "this panel", "floor": "the floor", "plain": "plain <way>", "nicegui": "NiceGUI"}


def phase(**peers: dict[str, Any]) -> dict[str, Any]:
    return {"rounds": [peers]}


def results(**phases: Any) -> dict[str, Any]:
    return {"faults": {}, "sizes": {"crowds": [1, 500]}, **phases}


def by_text(judged: list[Target], text: str) -> Target:
    return next(target for target in judged if text in target.text)


@pytest.mark.parametrize(
    ("percent", "expected"), [(0, 1.0), (50, 2.5), (75, 3.25), (99, 3.97), (100, 4.0)]
)
def test_a_percentile_lies_between_the_two_nearest_values(percent: float, expected: float) -> None:
    assert percentile([4.0, 1.0, 3.0, 2.0], percent) == pytest.approx(expected)


def test_percentile_of_no_values_is_nan() -> None:
    assert math.isnan(percentile([], 50))


def test_each_change_is_matched_to_when_it_showed() -> None:
    said = [(0.0, False), (10.0, True), (20.0, False)]
    shown = [(-5.0, True), (1.0, False), (12.0, True), (21.5, False)]
    assert toggles_matched(said, shown).ms == (1.0, 2.0, 1.5)


def test_late_change_is_not_lost() -> None:
    said = [(0.0, False), (10.0, True), (20.0, False), (30.0, True)]
    shown = [(45.0, False), (45.1, True), (45.2, False), (45.3, True)]
    matched = toggles_matched(said, shown)
    assert matched.lost == 0
    assert matched.ms == pytest.approx((45.0, 35.1, 25.2, 15.3))


def test_change_that_never_showed_is_lost() -> None:
    said = [(0.0, False), (10.0, True), (20.0, False), (30.0, True)]
    matched = toggles_matched(said, [(21.0, False), (31.0, True)])
    assert matched.lost == 2
    assert matched.ms == (1.0, 1.0)


def test_a_press_counts_from_its_release_to_its_first_arrival() -> None:
    released = {"a": 0.0, "b": 10.0, "c": 20.0}
    heard = [(1.5, "a"), (12.0, "b"), (13.0, "b"), (14.0, "of somebody else")]
    matched, twice = presses_matched(released, heard)
    assert matched.ms == (1.5, 2.0)
    assert (matched.lost, twice) == (1, 1)


def test_age_after_a_stall_counts_from_the_put() -> None:
    went_on = 10_000 * MS
    shown = [
        (9_000 * MS, 8_999 * MS),  # before
        (10_001 * MS, 5_000 * MS),
        (10_002 * MS, 9_900 * MS),
        (10_003 * MS, 10_001 * MS),
    ]
    assert shown_after(shown, went_on, old_s=0.5) == (5_000.0, 1)


@pytest.mark.parametrize(
    ("ys", "linear"),
    [
        ((5.0, 6.0, 7.0, 9.0), True),  # a constant and a line
        ((0.0, 5.0, 7.0, 8.0), True),  # better than linear
        ((0.0, 1.0, 4.0, 16.0), False),
        ((1.0, 1.0, 1.0, 1.2), True),  # noise
    ],
)
def test_growth_is_linear_where_the_end_costs_no_more_than_the_beginning(
    ys: tuple[float, ...], linear: bool
) -> None:
    assert slope(list(zip((0.0, 1.0, 2.0, 4.0), ys, strict=True)), noise=0.25).linear is linear


def test_a_slope_is_given_in_one_unit() -> None:
    assert slope([(1, 12.0), (2, 14.0), (4, 18.0)], noise=0.0).per_unit == pytest.approx(2.0)


def test_ratio_without_a_rival_is_unknown() -> None:
    assert math.isnan(ratio(1.0, 0.0))
    assert math.isnan(ratio(1.0, math.nan))


def test_a_figure_is_the_median_of_the_rounds_that_have_it() -> None:
    measured = {"down": {"rounds": [{"kiosk": {"p50": p50}} for p50 in (3.0, 1.0, 2.0, None)]}}
    assert figure(measured, "down", "kiosk", "p50") == 2.0
    assert math.isnan(figure(measured, "down", "plain", "p50"))
    assert math.isnan(figure(measured, "up", "kiosk", "p50"))


def test_the_best_rival_is_neither_this_panel_nor_the_floor() -> None:
    down = phase(kiosk={"p50": 1.0}, floor={"p50": 0.5}, plain={"p50": 1.2}, nicegui={"p50": 2.0})
    assert best_rival(results(down=down), "down", "p50") == ("plain", 1.2)


def test_targets_are_judged_by_measured_figures() -> None:
    down = phase(
        kiosk={"p50": 1.2, "p99": 3.7}, floor={"p50": 0.9, "p99": 1.0}, plain={"p50": 1.2, "p99": 1.9}
    )
    judged = targets(results(down=down))
    assert by_text(judged, "best rival's: at most 1 ×").reached is True
    assert by_text(judged, "of the floor's").measured == "1.33 ×"
    assert by_text(judged, "of the floor's").reached is True
    assert by_text(judged, "of its own p50").reached is False


def test_target_below_a_limit_is_missed_at_the_limit() -> None:
    cost = phase(kiosk={"server_1000": 4.0, "server_wide": 19.9})
    judged = targets(results(cost=cost))
    assert by_text(judged, "1 kHz on a topic: server").reached is False
    assert by_text(judged, "100 topics").reached is True


def test_memory_of_each_client_counts_in_kilobytes() -> None:
    judged = targets(results(cost=phase(kiosk={"mib_1": 70.0, "mib_500": 94.0})))
    assert by_text(judged, "memory of each").measured == "50.4 kB"
    assert by_text(judged, "memory of each").reached is True


def test_target_without_a_measurement_is_not_reached() -> None:
    assert {target.reached for target in targets(results())} == {None}


def test_growth_is_given_for_each_axis_that_was_measured() -> None:
    points = [[1, 2.0, 60.0, 0.1], [4, 5.0, 61.0, 0.1], [8, 9.0, 62.3, 0.1]]
    (growth,) = grown(results(growth={"rounds": [{"robots": {"points": points}}]}))
    assert growth.axis.unit == "robot"
    assert growth.cpu_slope.per_unit == pytest.approx(1.0)
    assert growth.cpu_slope.linear
    assert growth.mib == (60.0, 61.0, 62.3)


def test_the_results_are_given_with_whatever_there_is(tmp_path: Path) -> None:
    page = tmp_path / "benchmark.md"
    page.write_text(f"before\n{BEGIN}\nwhat was there\n{END}\nafter\n")
    measured = results(up=phase(kiosk={"p50": 1.0, "p99": 2.5}), faults={"nicegui": "not installed"})
    write(measured, TITLES, tmp_path, page)
    text = page.read_text()
    assert text.startswith(f"before\n{BEGIN}\n")
    assert text.endswith(f"{END}\nafter\n")
    assert "what was there" not in text
    assert "| this panel | – | – | 1.00 / 2.50 |" in text
    assert "NiceGUI: not installed" in text
    assert whole(measured, TITLES) == (tmp_path / "results.md").read_text()


def test_a_page_without_the_section_stays_as_it_is(tmp_path: Path) -> None:
    page = tmp_path / "benchmark.md"
    page.write_text("nothing here\n")
    with pytest.raises(ValueError, match="has no section"):
        write(results(), TITLES, tmp_path, page)
    assert page.read_text() == "nothing here\n"


def test_the_picture_has_a_bar_for_each_peer_that_was_measured() -> None:
    down = phase(kiosk={"p50": 1.0, "p99": 2.0}, plain={"p50": 1.5, "p99": 90.0})
    drawn = ElementTree.fromstring(picture(results(down=down), TITLES))
    words = [text.text for text in drawn.iter("{http://www.w3.org/2000/svg}text")]
    assert words[1:] == ["this panel", "1.00 / 2.0", "plain <way>", "1.50 / 90.0"]


def test_results_are_kept_as_they_come(tmp_path: Path) -> None:
    store = Store(tmp_path / "results.json")
    store.begin("down")
    store.add("down", 0, "kiosk", {"p50": 1.23456, "p99": math.nan})
    with store.faults("down: plain"):
        raise AssertionError("it did not answer\nand much more")
    again = Store(tmp_path / "results.json").results
    assert again["down"]["rounds"] == [{"kiosk": {"p50": 1.235, "p99": None}}]
    assert store.results["faults"] == {"down: plain": "AssertionError: it did not answer"}


@pytest.mark.parametrize(
    "text",
    [
        panel(()),
        panel(("/t0", "/t1"), buttons=20),
        panel(("/t0",), widgets=50),
        panel(
            ("/t0",), robots=(Robot("robot1", "tcp/127.0.0.1:1"), Robot("robot2", "tcp/127.0.0.1:2"))
        ),
    ],
)
def test_the_benchmarks_panels_can_be_used(text: str, tmp_path: Path) -> None:
    path = tmp_path / "panel.toml"
    path.write_text(text)
    assert load_panel(path).title == "Benchmark"


def test_rmw_zenoh_is_held_against_the_bridge() -> None:
    measured = results(
        dialects=phase(
            **{
                "kiosk-bridge": {"down_p50": 4.0, "up_p50": 2.0, "server_1000": 3.0},
                "kiosk-rmw": {"down_p50": 2.0, "up_p50": 3.0, "server_1000": 3.0},
            }
        )
    )
    judged = {target.text.split(",")[0]: target for target in targets(measured) if "rmw" in target.text}
    assert [target.measured for target in judged.values()] == ["0.50 ×", "1.50 ×", "1.00 ×"]
    assert [target.reached for target in judged.values()] == [True, False, True]
    assert "| over the bridge | 4.00" in whole(
        measured | {"machine": {}}, {"kiosk-bridge": "over the bridge"}
    )


def test_a_row_beside_its_floor_says_what_is_asked() -> None:
    rows = {
        "a press": {
            "unit": "ms",
            "panel": 5.0,
            "floor": 1.0,
            "ratio": 5.0,
            "asked": 3.5,
            "reached": False,
        },
        "idle": {"unit": "%", "panel": 1.5, "floor": 0.2, "ratio": 7.5, "asked": 2, "reached": True},
    }
    text = whole(results(light={"rounds": [rows]}), TITLES)
    assert "| a press | 5 ms | 1 ms | 5.00 × | 3.5 ×: missed |" in text
    assert "| idle | 1.5 % | 0.2 % | 7.50 × | 2 % |" in text

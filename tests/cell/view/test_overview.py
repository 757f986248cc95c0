"""The line of sums of an overview."""

from typing import Any

from app.cell.view.kinds import Attributes
from app.cell.view.overview import TileFigure, Tiles, sums
from app.panel.widgets.displays import Readout
from app.system.texts import TextLike, number

WORDS: list[TextLike] = ["Running", "Waiting", "Fault", "Running"]  # of two values
READOUT = Readout.model_validate(
    {
        "id": "rate",
        "kind": "readout",
        "label": "Rate",
        "topic": "/rate",
        "type": "std_msgs/msg/Float32",
        "unit": "boxes/h",
        "format": ".1f",
    }
)


def tiles(*texts: str) -> list[Attributes]:
    return [{"text": text} for text in texts]


def counted(shown: Attributes, robots: int) -> list[tuple[str, str]]:
    return [(shown[f"count{place}"], shown[f"text{place}"]) for place in range(robots)]


def test_robots_are_counted_in_the_order_of_the_panels_states() -> None:
    shown = sums(tiles("Old", "Fault", "Running", "Lost", "Running", "Old"), WORDS, [], None)
    assert counted(shown, 6) == [
        ("2", "Running"),
        ("1", "Fault"),
        ("2", "Old"),
        ("1", "Lost"),
        ("", ""),
        ("", ""),
    ]


def test_a_panel_without_states_counts_what_its_robots_are() -> None:
    assert counted(sums(tiles("Ready", "Ready"), [], [], None), 2) == [("2", "Ready"), ("", "")]


def test_a_total_is_written_as_a_figure() -> None:
    figures = [TileFigure(number=1.5, live=True), TileFigure(number=2.25, live=True)]
    shown = sums(tiles("Ready", "Ready"), [], figures, READOUT)
    assert shown["total"] == number("3.8", "boxes/h")
    assert shown["total_state"] == "live"


def test_a_total_with_an_old_figure_is_old() -> None:
    figures = [TileFigure(number=1.5, live=True), TileFigure(number=2.25, live=False)]
    shown = sums(tiles("Ready", "Lost"), [], figures, READOUT)
    assert (shown["total"], shown["total_state"]) == (number("3.8", "boxes/h"), "old")


def test_a_total_without_one_of_its_figures_is_not_known() -> None:
    figures = [TileFigure(number=1.5, live=True), TileFigure(number=None, live=False)]
    shown = sums(tiles("Ready", "Lost"), [], figures, READOUT)
    assert (shown["total"], shown["total_state"]) == ("—", "waiting")


def view(word: str, **shown: Attributes) -> Any:
    return {"state": {"state": "online", "text": word}, "widgets": shown}


LAMP: Any = {"text": "Connected", "state": "online"}
LOST: Any = {**LAMP, "text": "Lost"}


def test_a_tile_is_made_again_only_when_what_it_shows_has_changed() -> None:
    made = Tiles([], None)
    rate = {"text": "1", "state": "live"}
    first = made.tile("a", view("Ready", rate=rate, other={"text": "1"}), LAMP, "rate", None)
    again = made.tile("a", view("Ready", rate={**rate}, other={"text": "2"}), LAMP, "rate", None)
    assert again is first
    changed = [
        made.tile("a", view("Ready", rate={**rate, "text": "2"}), LAMP, "rate", None),
        made.tile("a", view("Fault", rate=rate), LAMP, "rate", None),
        made.tile("a", view("Fault", rate=rate), LOST, "rate", None),
    ]
    assert [(tile["figure"], tile["text"], tile["link"]) for tile in changed] == [
        ("2", "Ready", "Connected"),
        ("1", "Fault", "Connected"),
        ("1", "Fault", "Lost"),
    ]


def test_sums_are_made_again_only_when_a_tile_or_a_figure_has_changed() -> None:
    made = Tiles([], None)
    first = made.sums(tiles("Ready", "Ready"), [])
    assert made.sums(tiles("Ready", "Ready"), []) is first
    assert counted(made.sums(tiles("Ready", "Lost"), []), 2) == [("1", "Ready"), ("1", "Lost")]
